"""Virtual instruments on a TCP port, for tests of software that controls a stage."""
