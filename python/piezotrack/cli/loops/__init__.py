"""Commands on controllers: tracking, contouring, learning, tuning, export."""
