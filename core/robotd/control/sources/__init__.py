"""Setpoint sources: each decides the next setpoint of some axes, and how their motion ends.

A worker of the layer above, groups, makes a source and submits it to a slot of the loop. From then
on the control-loop thread calls ``advance`` once a period, and nothing here may block. Any thread
may request its end, wait for its completion, and put commands into a stream.
"""
