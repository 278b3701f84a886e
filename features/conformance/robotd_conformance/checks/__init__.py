"""The checks that every backend must pass; docs/reference/conformance.md lists them.

``robotd conform --backend NAME`` runs them, or
``pytest --pyargs robotd_conformance.checks --robotd-backend NAME``. Every check goes through
the driver contracts and ``Robot`` alone. What a backend declares as capabilities, and what its
``FaultInjector`` can do, decides which checks are skipped; the report shows what share was left.
"""
