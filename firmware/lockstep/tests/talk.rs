//! The Python programs of docs/talk-to-the-ecu.md, run as a reader runs them, on the ECU's own time: against the
//! lock-step image in QEMU, and against the same controller in this process, behind the same protocol on a TCP port.
//! Neither a loaded host nor a slow Python can make them fail: the ECU steps when they say so.
//!
//! Python's packages (examples/requirements.txt) are installed into target/python at the first run.

use std::io::{BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use haptic_core::bus::Frame;
use haptic_core::bus::slcan::{self, Line, Parser};
use haptic_core::controller::config::Setup;
use haptic_core::ecu::{Boot, Ecu};
use haptic_lockstep::{SimTime, StepCost};

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// A Python with what the programs import.
fn python() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| {
        let place = root().join("target/python");
        let python = place.join("bin/python");
        let imports = |python: &Path| {
            let imports = Command::new(python)
                .args(["-c", "import can, cantools, serial"])
                .output();
            imports.is_ok_and(|output| output.status.success())
        };
        if !imports(&python) {
            let run = |command: &mut Command, what: &str| {
                let output = command.output().unwrap_or_else(|e| panic!("{what}: {e}"));
                let said = String::from_utf8_lossy(&output.stderr).into_owned();
                assert!(output.status.success(), "{what}: {said}");
            };
            run(
                Command::new("python3").args(["-m", "venv"]).arg(&place),
                "python3 -m venv",
            );
            let mut install = Command::new(&python);
            install.args([
                "-m",
                "pip",
                "install",
                "--quiet",
                "-r",
                "examples/requirements.txt",
            ]);
            run(
                install.current_dir(root()),
                "pip install -r examples/requirements.txt",
            );
        }
        python
    })
}

/// Runs a program of the examples; what it prints.
fn run(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(python())
        .current_dir(root())
        .arg(format!("examples/{program}"))
        .args(arguments)
        .output()
        .unwrap();
    let said = format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(output.status.success(), "{program}: {said}");
    said
}

/// Answers one client as the lock-step image does.
fn serve(client: TcpStream) {
    client.set_nodelay(true).unwrap();
    let mut to = client.try_clone().unwrap();
    let mut parser = Parser::default();
    let (mut ecu, mut frames): (Option<Ecu>, Vec<Frame>) = (None, Vec::new());
    for byte in BufReader::new(client).bytes().map_while(Result::ok) {
        let Some(line) = parser.push(byte) else { continue };
        let mut answer = line.answer().to_vec();
        if let Line::Frame(frame) = line {
            match SimTime::decode(&frame) {
                None => frames.push(frame),
                Some(SimTime(now)) => {
                    let ecu = ecu.get_or_insert_with(|| Ecu::new(Some(&Setup::PAPER), Boot::default(), now));
                    for frame in frames.drain(..) {
                        let _ = ecu.receive(&frame, now);
                    }
                    let step = ecu.step(now);
                    let background = ecu.background_step();
                    let cost = StepCost {
                        cycles: 0,
                        background_cycles: 0,
                    };
                    let sent = core::iter::once(&step.guidance)
                        .chain(&step.others)
                        .chain(&background);
                    sent.for_each(|frame| answer.extend_from_slice(&slcan::format(frame)));
                    answer.extend_from_slice(&slcan::format(&cost.encode()));
                }
            }
        }
        if to.write_all(&answer).is_err() {
            return;
        }
    }
}

/// The channel of an ECU in this process, for one client.
fn here() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let channel = format!("socket://{}", listener.local_addr().unwrap());
    std::thread::spawn(move || serve(listener.accept().unwrap().0));
    channel
}

#[test]
fn the_program_of_the_page_drives_and_watches_a_handover() {
    let said = run("talk_to_the_ecu.py", &[&here(), "--lockstep", "--seconds", "20"]);
    assert!(
        said.contains("Active for 20 s, a handover, and back to Standby"),
        "{said}"
    );
    // The modes in their order, each once.
    let modes: Vec<&str> = said
        .lines()
        .filter_map(|line| line.split_once(" s  ")?.1.split_whitespace().next())
        .collect();
    let mut order = modes.clone();
    order.dedup();
    assert_eq!(order, ["Standby", "Active", "Handover", "Standby"], "{said}");
}

#[test]
fn the_lock_step_client_of_the_page_ticks() {
    let said = run("lockstep_client.py", &[&here()]);
    assert!(said.contains("1,000 ticks") && said.contains("0xc0"), "{said}");
}

/// `cargo xtask qemu lockstep` runs in one shell and the program in the other, as the page says.
#[test]
fn the_program_of_the_page_drives_the_image_in_qemu() {
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut qemu = Command::new(cargo)
        .current_dir(root())
        .args(["xtask", "qemu", "lockstep", "--timeout", "600", "--can"])
        .arg(format!("tcp:127.0.0.1:{port},server,nowait"))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Its log begins when it runs.
    let mut log = BufReader::new(qemu.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("lockstep on") {
        line.clear();
        let n = std::io::BufRead::read_line(&mut log, &mut line).unwrap();
        assert!(n > 0, "cargo xtask qemu ended");
    }
    std::thread::spawn(move || std::io::copy(&mut log, &mut std::io::sink()));
    let channel = format!("socket://127.0.0.1:{port}");
    let said = run("talk_to_the_ecu.py", &[&channel, "--lockstep", "--seconds", "4"]);
    assert!(said.contains("back to Standby"), "{said}");
    // The channel is closed, and with it the image ends.
    assert!(qemu.wait().unwrap().success());
}
