pytest_plugins = ["robotd.testing.robots"]
