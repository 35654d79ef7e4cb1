//! The controller behind every door, on the bus of one whole run: the frames that it sends must be the same bits.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::Stdio;

use anyhow::{Context, Result, bail};

use crate::built::Built;
use crate::tool::{command, output, root, run};
use crate::{c_library, fmu, python, web};

const SCENARIO: &str = "examples/relying-driver.toml";
/// The bus as the doors read it.
const BUS: &str = "target/bindings-agree/bus.txt";
/// Identifiers of what the ECU hears from the camera, the column, the vehicle and the host.
const INPUTS: [&str; 4] = ["100", "110", "120", "130"];

/// Prints the table, and fails where a door sends another bit.
pub(crate) fn check(built: Built) -> Result<()> {
    let out = root().join("target/bindings-agree/run");
    run(command(built.host_sim()?)
        .args(["run", SCENARIO, "--bus-log", "--out"])
        .arg(&out)
        .stdout(Stdio::null()))?;
    let bus = read(&out.join("bus.log"))?;
    let expected: Vec<&str> = bus.lines().filter(|line| !is_input(line)).collect();
    let mut in_python = python::with_package(built)?;
    in_python.arg("bindings/python/replay.py");
    let mut simulated = python::with_package(built)?;
    simulated.arg("bindings/python/simulated.py").arg(SCENARIO);
    let in_c = command(c_library::replay(built)?);
    println!("{SCENARIO}, frames that the controller sent\n");
    println!("{:<20} {:>9} {:>9}", "door", "frames", "differing");
    println!("{:<20} {:>9} {:>9}", "command line", expected.len(), "-");
    let mut differing = Vec::new();
    let mut row = |door: &str, frames: usize, wrong: usize| {
        println!("{door:<20} {frames:>9} {wrong:>9}");
        if wrong > 0 || frames == 0 {
            differing.push(door.to_owned());
        }
    };
    let doors = [
        ("Python, Ecu", in_python),
        ("Python, simulate", simulated),
        ("C", in_c),
    ];
    for (door, mut program) in doors {
        let (frames, wrong) = compared(&replayed(&mut program, &bus)?, &expected);
        row(door, frames, wrong);
    }
    let in_file = root().join(BUS);
    let (frames, wrong) = compared(&web::replayed(&in_file, built)?, &expected);
    row("WebAssembly", frames, wrong);
    // The units take SI values and give SI values: torque, limit and mode of each guidance frame.
    fmu::build(built)?;
    let mut in_fmus = python::with_package(built)?;
    in_fmus
        .arg("bindings/fmu/agree.py")
        .arg(root().join("target/dist"));
    let said = replayed(&mut in_fmus, &bus)?;
    for (door, line) in ["FMU, FMI 2.0", "FMU, FMI 3.0"].into_iter().zip(said.lines()) {
        let (frames, wrong) = line.split_once(' ').context("two numbers are wanted")?;
        row(door, frames.parse()?, wrong.parse()?);
    }
    if said.lines().count() != 2 {
        bail!("the FMUs did not answer");
    }
    if expected.is_empty() || !differing.is_empty() {
        bail!("not the same bits: {}", differing.join(", "));
    }
    Ok(())
}

/// Frames that were sent, and how many are not those expected.
fn compared(sent: &str, expected: &[&str]) -> (usize, usize) {
    let sent: Vec<&str> = sent.lines().collect();
    let same = sent.iter().zip(expected).filter(|(a, b)| a == b).count();
    (sent.len(), sent.len().max(expected.len()) - same)
}

fn is_input(line: &str) -> bool {
    line.split(' ').nth(1).is_some_and(|id| INPUTS.contains(&id))
}

/// A log of candump as lines of `t_us id data`.
fn read(log: &Path) -> Result<String> {
    let text = std::fs::read_to_string(log).with_context(|| log.display().to_string())?;
    let mut lines = String::new();
    for line in text.lines() {
        let parts: Vec<&str> = line.split(' ').collect();
        let [time, _, frame] = parts[..] else {
            bail!("{}: {line:?} is no line of candump -L", log.display());
        };
        let seconds: f64 = time.trim_matches(['(', ')']).parse()?;
        let (id, data) = frame.split_once('#').context("a frame without #")?;
        writeln!(lines, "{} {id} {data}", (seconds * 1e6).round() as u64)?;
    }
    Ok(lines)
}

/// What a program answers to the bus on its standard input.
fn replayed(program: &mut std::process::Command, bus: &str) -> Result<String> {
    // From a file, so that neither side waits for the other.
    let mut file = std::fs::File::create(root().join(BUS))?;
    file.write_all(bus.as_bytes())?;
    let file = std::fs::File::open(root().join(BUS))?;
    output(program.stdin(Stdio::from(file)))
}
