"""Commands that control a stage: tables, loops, gains, exports."""
