"""The process of the command: signals, streams, folders."""
