"""ESI files beside slaves on a cable, which pysoem scans."""

from __future__ import annotations

import json
from pathlib import Path

from click.testing import CliRunner, Result
from tests.plugins.ethercat.bus.slaves_of import PATIENCE_S

from robotd.cli import main
from robotd.clock import MonotonicClock, wait_until
from robotd_ethercat.bus_namespace import run_in_namespace
from robotd_ethercat.slaves_process import SlavesProcess

VENDOR = 0x52424F54
ESI = """\
<EtherCATInfo>
  <Vendor><Id>#x52424F54</Id><Name>robotd</Name></Vendor>
  <Descriptions><Devices><Device>
    <Type ProductCode="1" RevisionNo="0">GENERIC</Type><Name>Generic slave of the tests</Name>
    <TxPdo Sm="3"><Index>#x1A00</Index><Name>Inputs</Name>
      <Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen><Name>1</Name></Entry>
    </TxPdo>
  </Device></Devices></Descriptions>
</EtherCATInfo>
"""


def scan(slaves: SlavesProcess, *words: str) -> Result:
    """Scan until all slaves have an identity: on a busy computer the library misses frames."""
    arguments = ["ethercat", "scan", "--interface", slaves.interface, *words]
    done: list[Result] = []

    def scanned() -> bool:
        run_in_namespace(slaves.namespace, lambda: done.append(CliRunner().invoke(main, arguments)))
        assert done[-1].exit_code == 0, done[-1].output
        if "--json" not in words:
            return done[-1].output.count(f": vendor 0x{VENDOR:08X}") == 3
        found = json.loads(done[-1].stdout)["slaves"]
        return [slave["vendor_id"] for slave in found] == [VENDOR] * 3

    assert wait_until(scanned, PATIENCE_S, MonotonicClock()), done[-1].output
    return done[-1]


def test_a_scan_names_the_slaves(generic_slaves: SlavesProcess, tmp_path: Path) -> None:
    (tmp_path / "generic.xml").write_text(ESI, encoding="utf-8")
    (tmp_path / "broken.xml").write_text(ESI[:300], encoding="utf-8")
    result = scan(generic_slaves, "--esi", str(tmp_path))
    assert result.output.count("ESI generic.xml: Generic slave of the tests (robotd)") == 3
    assert "ESI left out: " in result.stderr
    found = json.loads(scan(generic_slaves, "--json", "--esi", str(tmp_path)).stdout)
    assert len(found["slaves"]) == 3


def test_a_scan_needs_no_esi(generic_slaves: SlavesProcess, tmp_path: Path) -> None:
    assert scan(generic_slaves, "--esi", str(tmp_path)).output.count("no ESI") == 3
    assert "ESI" not in scan(generic_slaves).output
