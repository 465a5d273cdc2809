"""Commands on devices, real and virtual."""
