"""Many workers: the same bytes as one process, also when a worker dies; nothing listens beyond this machine unasked."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from framepairs import fleet as fleets
from framepairs.errors import InputError, MachineError
from framepairs.fleet import Fleet, connected, fleet_renderer, scheduler_address
from framepairs.options import make_job
from framepairs.orders import job_of, order_of
from framepairs.pipeline import render_sequence
from framepairs.plan import make_plan
from test_pipeline import contents
from test_unbreakable import write_scene

FRAMES = 24
VARIANT = "llvm_ad_rgb"


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    return write_scene(tmp_path_factory.mktemp("files"))


def job_in(files: Path, out: Path, **plan):
    values = make_plan({"display": (96, 54), "antialiasing": 4} | plan)
    return make_job(str(files / "quad.obj"), files / "quad.obj", str(files / "flight.json"), values, out)


@pytest.fixture(scope="module")
def reference(files, tmp_path_factory) -> dict[str, str]:
    job = job_in(files, tmp_path_factory.mktemp("one") / "corpus")
    list(render_sequence(job, range(FRAMES)))
    return contents(job.out)


@pytest.fixture(scope="module")
def client():
    with connected(Fleet(workers=2), VARIANT) as found:
        found.wait_for_workers(2)
        yield found


def rendered(client, job, frames=range(FRAMES), order=None, **options):
    fleet = Fleet(workers=2, frames_per_task=3, **options)
    yield from render_sequence(job, frames, renderer=fleet_renderer(client, order or order_of(job), fleet))


def test_two_workers_write_what_one_process_writes(client, files, reference, tmp_path):
    job = job_in(files, tmp_path / "corpus")
    steps = list(rendered(client, job))
    assert sorted(step.frame for step in steps) == list(range(FRAMES))
    assert len({step.worker for step in steps}) == 2
    assert contents(job.out) == reference
    assert {step.rendered for step in rendered(client, job)} == {False}


def test_a_worker_that_is_killed_leaves_no_trace(client, files, reference, tmp_path):
    job = job_in(files, tmp_path / "corpus")
    processes = client.run(os.getpid)
    steps, killed = rendered(client, job), None
    for step in steps:
        if killed is None:
            killed = step.worker
            os.kill(processes[killed], signal.SIGKILL)
            (job.out / job.sequence / "hr" / "color" / ".000004.exr.0123abcd.part").touch()  # as it may leave one
    assert contents(job.out) == reference
    client.wait_for_workers(2)
    assert killed not in client.run(os.getpid)  # its successor has another address


def test_another_path_reads_the_scene_once(client, files, tmp_path):
    job = job_in(files, tmp_path / "corpus")
    list(rendered(client, job))
    before = order_of(job)
    other = replace(job, path_name="second", split="val")
    assert job_of(order_of(other), (before, job)).scene is job.scene
    rough = replace(job, plan=make_plan(job.plan.model_dump() | {"anisotropy": 2}))
    assert job_of(order_of(rough), (before, job)).scene is not job.scene


def test_nothing_listens_beyond_this_machine(client):
    here = psutil.Process()
    processes = [here, *here.children(recursive=True)]
    ports = [c.laddr for p in processes for c in p.net_connections(kind="inet") if c.status == psutil.CONN_LISTEN]
    assert len(ports) >= 3 and {address.ip for address in ports} == {"127.0.0.1"}


def test_a_worker_with_another_scene_is_refused_and_says_so(client, files, tmp_path):
    job = job_in(files, tmp_path / "corpus")
    order = replace(order_of(job), sources=order_of(job).sources | {"scene": "0" * 64})
    with pytest.raises(InputError, match=f"quad.obj: this machine has another scene: {job.scene_sha256}, not 0000"):
        list(rendered(client, job, order=order))
    order = replace(order_of(job), sources=job.sources | {"versions": job.sources["versions"] | {"mitsuba": "1.0"}})
    with pytest.raises(InputError, match="another versions: mitsuba 3.9.1, not 1.0"):
        list(rendered(client, job, order=order))


def test_bad_input_is_not_tried_again_and_names_the_file(client, files, tmp_path):
    job = job_in(files, tmp_path / "corpus")
    order = replace(order_of(job), scene_file=tmp_path / "gone.obj")

    def errors(dask_scheduler) -> int:
        return sum(entry[2] == "erred" or entry[1:3] == ("processing", "waiting") for entry in dask_scheduler.transition_log)

    before = client.run_on_scheduler(errors)
    with pytest.raises(InputError, match="gone.obj: no such scene"):
        list(rendered(client, job, order=order))
    assert client.run_on_scheduler(errors) == before
    assert not list(job.out.glob("*/frames/*")) and not (job.out / ".lock").exists()


def test_a_worker_whose_client_has_gone_writes_no_more(client, files, tmp_path):
    """What it holds is the token of a lock that is no more, or another's."""
    job = job_in(files, tmp_path / "corpus")
    steps = rendered(client, job, sharing_s=1, retries=0)
    next(steps)
    (job.out / ".lock").write_text("pid=1\nhost=elsewhere\ntoken=another\n")
    with pytest.raises(MachineError, match="hold.* the lock of this corpus no more|the client's lock is not there|was lost"):
        list(steps)
    there = len(list(job.out.glob("*/frames/*.json")))
    time.sleep(1)
    assert len(list(job.out.glob("*/frames/*.json"))) == there < FRAMES


def test_a_scheduler_that_dies_is_named(files, tmp_path):
    scheduler = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
         "--dashboard-address", "127.0.0.1:0", "--scheduler-file", str(tmp_path / "scheduler.json")],
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    while not (tmp_path / "scheduler.json").is_file():
        time.sleep(0.05)
    address = scheduler_address(Fleet(scheduler=str(tmp_path / "scheduler.json")))
    worker = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"],
        stderr=subprocess.DEVNULL,
    )
    try:
        with connected(Fleet(scheduler=address, patience_s=60), VARIANT) as found:
            job = job_in(files, tmp_path / "corpus")
            with pytest.raises(MachineError, match="lost the scheduler|no worker has been there"):
                for _ in rendered(found, job, patience_s=5):
                    scheduler.kill()
    finally:
        for child in (scheduler, worker):
            child.kill()
            child.wait()
    assert not (job.out / ".lock").exists()


def test_a_folder_that_is_not_shared_is_noticed(client, files, tmp_path):
    job = job_in(files, tmp_path / "corpus")
    order = replace(order_of(job), out=tmp_path / "elsewhere")
    with pytest.raises(MachineError, match="elsewhere on tcp://.*: the client's lock is not there: .* all machines share"):
        list(rendered(client, job, order=order, sharing_s=0.5, retries=0))
    assert not (tmp_path / "elsewhere").exists()


def test_a_worker_that_cannot_write_is_an_error_of_the_machine(client, files, tmp_path):
    job = job_in(files, tmp_path / "corpus")
    steps = rendered(client, job, retries=0)
    next(steps)
    for frames in job.out.glob("*/frames"):
        frames.rename(tmp_path / "frames")
        frames.write_text("")
    with pytest.raises(MachineError, match="frames.*: cannot be written"):
        list(steps)


def test_a_scheduler_without_workers_or_none_at_all(client):
    from distributed import Scheduler, SpecCluster

    options = {"host": "127.0.0.1", "port": 0, "dashboard": False, "dashboard_address": "127.0.0.1:0"}
    with SpecCluster(scheduler={"cls": Scheduler, "options": options}, workers={}) as empty:
        address = empty.scheduler_address
        lonely = connected(Fleet(scheduler=address, patience_s=1), VARIANT)
        with pytest.raises(MachineError, match="no worker came to .* within 1 s"), lonely:
            pass
    monkey = Fleet(scheduler="tcp://127.0.0.1:9", patience_s=1)
    with pytest.raises(MachineError, match="cannot reach the scheduler|no worker came"), connected(monkey, VARIANT):
        pass


@pytest.mark.parametrize(
    ("fleet", "says"),
    [
        (Fleet(scheduler="tcp://10.1.2.3:8786"), "another machine without TLS"),
        (Fleet(scheduler="tcp://cluster.example:8786"), "another machine without TLS"),
        (Fleet(scheduler="ws://10.1.2.3:8786"), "another machine without TLS"),
        (Fleet(scheduler="http://127.0.0.1:8786"), "must look like tls://host:8786"),
        (Fleet(scheduler="gone.json"), "gone.json: no address"),
        (Fleet(scheduler="tcp://"), "must look like"),
    ],
)
def test_addresses_that_are_refused(fleet, says):
    with pytest.raises(InputError, match=says):
        scheduler_address(fleet)


def test_addresses_that_are_taken(tmp_path):
    for address in ("tls://10.1.2.3:8786", "tcp://127.0.0.1:8786", "tcp://localhost:8786", "tcp://[::1]:8786"):
        assert scheduler_address(Fleet(scheduler=address)) == address
    assert scheduler_address(Fleet(scheduler="tcp://10.1.2.3:8786", insecure=True)) == "tcp://10.1.2.3:8786"
    file = tmp_path / "scheduler.json"
    file.write_text(json.dumps({"type": "Scheduler", "address": "tls://10.1.2.3:8786"}))
    assert scheduler_address(Fleet(scheduler=str(file))) == "tls://10.1.2.3:8786"
    for text in ("{", "[]", '{"workers": {}}'):
        file.write_text(text)
        with pytest.raises(InputError, match="scheduler.json: is no scheduler file"):
            scheduler_address(Fleet(scheduler=str(file)))


def test_one_gpu_per_worker(monkeypatch):
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "2,5")
    options = [w["options"] for w in fleets._specification(Fleet(), "cuda_ad_rgb")["workers"].values()]
    assert [o["env"] for o in options] == [{"CUDA_VISIBLE_DEVICES": "2"}, {"CUDA_VISIBLE_DEVICES": "5"}]
    options = [w["options"] for w in fleets._specification(Fleet(workers=3), "llvm_ad_rgb")["workers"].values()]
    assert [(o["env"], o["nthreads"], o["host"]) for o in options] == [({}, 1, "127.0.0.1")] * 3


def test_a_scheduler_that_speaks_tls(files, tmp_path):
    import shutil

    if shutil.which("openssl") is None:
        pytest.skip("no openssl to make a certificate with")
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    request = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"]
    subprocess.run([*request, "-keyout", key, "-out", certificate], check=True, capture_output=True)
    from distributed import Nanny, Scheduler, Security, SpecCluster

    names = ("tls_ca_file", "tls_scheduler_cert", "tls_worker_cert", "tls_client_cert")
    keys = {f"tls_{who}_key": str(key) for who in ("scheduler", "worker", "client")}
    security = Security(require_encryption=True, **dict.fromkeys(names, str(certificate)), **keys)
    alone = {"host": "127.0.0.1", "dashboard": False, "dashboard_address": "127.0.0.1:0", "security": security}
    worker = {"cls": Nanny, "options": alone | {"nthreads": 1, "memory_limit": 0}}
    scheduler = {"cls": Scheduler, "options": alone | {"port": 0, "protocol": "tls"}}
    with SpecCluster(scheduler=scheduler, workers={0: worker}, security=security) as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tls://")
        speaking = Fleet(scheduler=address, tls=(certificate, certificate, key), patience_s=30)
        with connected(speaking, VARIANT) as found:
            job = job_in(files, tmp_path / "corpus")
            assert len(list(rendered(found, job, range(4)))) == 4
        silent = Fleet(scheduler=address, patience_s=5)
        with pytest.raises(MachineError, match="cannot reach the scheduler"), connected(silent, VARIANT):
            pass
