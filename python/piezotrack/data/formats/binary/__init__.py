"""Binary formats of logs, most of them containers that a library reads."""
