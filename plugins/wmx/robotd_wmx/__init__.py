"""WMX backend: a robot behind the WMX3 motion engine and its EtherCAT master.

``plugin`` has the hooks; ``connection`` shows which thread owns which device of the engine.
Nothing is imported here, so that the doctor can say why the binding does not load.
"""
