"""Report of the reproduction: tables, figures, pages."""
