"""The workbench over HTTP: start a server, submit a job, wait for it, fetch its report and program, stop the server.

.venv/bin/python examples/drive_http.py [FOLDER]      needs the extra `workbench`
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from urllib.request import Request, urlopen

COURSES = Path(__file__).parent / "cylinder_panel_15.txt"
SERVE = (sys.executable, "-c", "from tapelayer.dispatch import main; main()", "serve", "--port", "0", "--no-open")
FORM = (
    '--next\r\nContent-Disposition: form-data; name="kind"\r\n\r\nlay\r\n'
    '--next\r\nContent-Disposition: form-data; name="file"; filename="{name}"\r\n\r\n{courses}\r\n--next--\r\n'
)


def main() -> None:
    """Do what a client does, with nothing but what comes with Python; docs/api.md has clients that do more."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as work:
        server = subprocess.Popen([*SERVE, "--work-dir", work], stdout=subprocess.PIPE, text=True)
        try:
            assert server.stdout
            said = server.stdout.readline()  # workbench: http://127.0.0.1:PORT/ ...
            if not said:
                sys.exit(server.wait())  # its own message says what is missing
            drive(said.split()[1].rstrip("/"), folder)
        finally:
            server.terminate()
            server.wait()


def drive(address: str, folder: Path) -> None:
    """Submit the course file to a server, and save the program that it made."""
    form = FORM.format(name=COURSES.name, courses=COURSES.read_text()).encode()
    headers = {"Content-Type": "multipart/form-data; boundary=next"}
    job = json.load(urlopen(Request(f"{address}/api/v1/jobs", form, headers)))
    own = f"{address}/api/v1/jobs/{job['id']}"
    while job["state"] in ("queued", "running"):
        time.sleep(0.2)
        job = json.load(urlopen(own))
    report = json.load(urlopen(f"{own}/report.json"))
    (folder / "panel.nc").write_bytes(urlopen(f"{own}/program").read())
    print(f"{job['name']}: {job['state']}, {report['blocks']} blocks")
    print(f"position error {report['max_position_error_mm']:.4f} mm, program in {folder / 'panel.nc'}")


if __name__ == "__main__":
    main()
