"""Servos on a serial bus: one thread, sync read and sync write, and no jump at torque-on.

Read in this order: ``servo_bus`` (what a family of servos provides), ``servo_record`` (judgement of
each reply), ``switching`` (on, off, alarms), ``exchange`` (the thread), ``device``, ``axes``.
"""
