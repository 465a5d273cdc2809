"""Adapters: devices of National Instruments, GCS and SCPI controllers, EPICS; and virtual ones."""
