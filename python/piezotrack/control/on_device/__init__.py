"""Controllers on a device: tables that it plays, and a loop that is closed point by point."""
