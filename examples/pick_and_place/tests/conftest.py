pytest_plugins = ["robotd_testing.robots"]
