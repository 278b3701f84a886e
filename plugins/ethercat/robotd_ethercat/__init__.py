"""EtherCAT for CiA 402 drives and I/O modules, and simulated slaves."""
