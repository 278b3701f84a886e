"""Control loop: what runs in each period, and what ends or rejects motion.

The thread ``robotd-control`` runs ``ControlLoop``, which calls everything here once a period and
never waits for another thread. ``SetpointSource`` is its interface to the layer above, sources:
it advances them through a slot of the ``SetpointMixer``. Workers submit sources to a slot, engage
the ``MotionStop`` and have commands admitted by a ``CommandSource``; the ``Watchdog`` has a thread
of its own. Nothing here knows groups, clients or ROS.
"""
