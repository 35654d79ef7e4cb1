//! What the nanoseconds of a lane's millisecond go to: where the program counter is while `bench/lanes.rs` runs.
//!
//! `perf` looks at it some thousand times a second, by the clock of the processor and not by its counters, which virtual
//! machines seldom have. The lines of the debug information, through all that was inlined, name the stage. A share of the
//! looks is a share of the time. Stages overlap in a processor: what waits for the result of another is counted where it
//! waits.

use std::collections::HashMap;
use std::io::Write;
use std::process::Stdio;

use anyhow::{Context, Result, ensure};
use object::{Object, ObjectSegment};

use crate::tool;

/// A stage and the functions that are it, as file and name; with an empty name all of the file. The innermost function that
/// stands here counts.
const STAGES: [(&str, &[(&str, &str)]); 11] = [
    (
        "the driver's two points on the road",
        &[("lanes/world.rs", "driver_looks")],
    ),
    (
        "the camera's two points, for law and samples",
        &[("lanes/world.rs", "camera_looks")],
    ),
    (
        "the centre of gravity on the road, for samples",
        &[("lanes/world.rs", "locate")],
    ),
    (
        "points that enter another cell of the road",
        &[("lanes/tracked.rs", "walk"), ("lanes/tracked.rs", "enter")],
    ),
    (
        "the driver's vision and its delay",
        &[("lanes/world.rs", "vision")],
    ),
    ("arm, column and vehicle", &[("lanes/world.rs", "linear")]),
    ("direction and place", &[("lanes/world.rs", "move_on")]),
    (
        "sensors, bus, law, probe and envelope",
        &[
            ("lanes/ecu.rs", ""),
            ("lanes/probe.rs", ""),
            ("lanes/sensing.rs", ""),
        ],
    ),
    ("the check of the monitor's band", &[("lanes/band.rs", "")]),
    ("the checks of lane and column", &[("lanes/checks.rs", "")]),
    ("the samples", &[("lanes/runs.rs", "record")]),
];
const REST: &str = "the rest";

/// Looks a second; no multiple of anything that the program does.
const LOOKS_PER_S: &str = "4999";

pub(crate) fn ensure_tools() -> Result<()> {
    tool::ensure(&[("perf", "linux-perf"), ("addr2line", "binutils")])
}

/// The share of each stage in the time of the lanes, in order of [`STAGES`], then of the rest.
pub(crate) fn shares(lanes: &str, width: &str) -> Result<Vec<(&'static str, f64)>> {
    let data = tool::root().join("target/lanes.perf");
    let data = data.to_string_lossy();
    let record = [
        "record",
        "-q",
        "-e",
        "cpu-clock:u",
        "-F",
        LOOKS_PER_S,
        "-o",
        &data,
        "--",
    ];
    let program = [lanes, "--width", width, "--repeat", "20"];
    tool::output(tool::command("perf").args(record).args(program))?;
    let script = ["script", "-i", &data, "--show-mmap-events", "-F", "ip"];
    let looks = addresses(lanes, &tool::output(tool::command("perf").args(script))?)?;
    let mut counts: HashMap<u64, u32> = HashMap::new();
    for address in looks {
        *counts.entry(address).or_default() += 1;
    }
    let mut sums = vec![0_u32; STAGES.len() + 1];
    for (address, chain) in functions(lanes, counts.keys())? {
        sums[stage_of(&chain)] += counts[&address];
    }
    let all: u32 = sums.iter().sum();
    ensure!(all > 1000, "perf looked at {lanes} {all} times only");
    let names = STAGES.iter().map(|(name, _)| *name).chain([REST]);
    Ok(names
        .zip(sums.iter().map(|n| f64::from(*n) / f64::from(all)))
        .collect())
}

/// Where the looks were, in the addresses of the file, from the text of `perf script`.
fn addresses(program: &str, script: &str) -> Result<Vec<u64>> {
    let bytes = std::fs::read(program).with_context(|| program.to_owned())?;
    let elf = object::File::parse(&*bytes)?;
    let (mut mapped, mut found) = (Vec::new(), Vec::new());
    for line in script.lines() {
        if let Some((_, map)) = line.split_once("PERF_RECORD_MMAP") {
            if map.trim_end().ends_with(program) {
                mapped.push(mapping(&elf, map).with_context(|| format!("perf says: {line}"))?);
            }
        } else if let Ok(ip) = u64::from_str_radix(line.trim(), 16) {
            let inside = mapped
                .iter()
                .find(|(start, length, _)| ip.wrapping_sub(*start) < *length);
            if let Some((start, _, address)) = inside {
                found.push(ip - start + address);
            }
        }
    }
    Ok(found)
}

/// Start, length and the file's address of `[0x5600(0x1000) @ 0x20000 fe:00 ..]`.
fn mapping(elf: &object::File, text: &str) -> Option<(u64, u64, u64)> {
    let hex = |text: &str| u64::from_str_radix(text.trim().strip_prefix("0x")?, 16).ok();
    let (_, place) = text.split_once('[')?;
    let (start, place) = place.split_once('(')?;
    let (length, place) = place.split_once(") @")?;
    let (start, length) = (hex(start)?, hex(length)?);
    let offset = match place.split_whitespace().next()? {
        "0" => 0,
        offset => hex(offset)?,
    };
    // Segments share pages of the file: that of instructions is wanted.
    let is_run =
        |flags| matches!(flags, object::SegmentFlags::Elf { p_flags } if p_flags & object::elf::PF_X != 0);
    let holds = |segment: &object::Segment| {
        let (from, size) = segment.file_range();
        from < offset + length && offset < from + size && is_run(segment.flags())
    };
    let segment = elf.segments().find(holds)?;
    Some((
        start,
        length,
        (offset + segment.address()).wrapping_sub(segment.file_range().0),
    ))
}

/// Functions from the innermost outwards, as place and name.
type Chain = Vec<(String, String)>;

/// The functions at each address.
fn functions<'a>(program: &str, addresses: impl Iterator<Item = &'a u64>) -> Result<Vec<(u64, Chain)>> {
    let mut child = tool::command("addr2line")
        .args(["-e", program, "-a", "-i", "-f", "-C"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .context("addr2line")?;
    let asked: String = addresses.map(|address| format!("{address:#x}\n")).collect();
    let mut input = child.stdin.take().context("addr2line takes no input")?;
    let writer = std::thread::spawn(move || input.write_all(asked.as_bytes()));
    let output = child.wait_with_output().context("addr2line")?;
    ensure!(output.status.success(), "addr2line: {}", output.status);
    writer
        .join()
        .expect("writing does not panic")
        .context("addr2line")?;
    let (mut chains, mut name): (Vec<(u64, Chain)>, _) = (Vec::new(), None);
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        if let Some(address) = line.strip_prefix("0x") {
            chains.push((u64::from_str_radix(address, 16)?, Vec::new()));
        } else if let Some(name) = name.take() {
            let (_, chain) = chains.last_mut().context("addr2line names no address")?;
            chain.push((line.to_owned(), name));
        } else {
            name = Some(line.to_owned());
        }
    }
    Ok(chains)
}

/// The number of the stage that a chain of functions belongs to, innermost first.
fn stage_of(chain: &[(String, String)]) -> usize {
    let of = |(place, name): &(String, String)| {
        let file = place.split(':').next().unwrap_or_default();
        // `haptic_sim::lanes::world::Worlds<N>::vision<8>` is `vision`.
        let name = name.rsplit("::").next().unwrap_or_default();
        let name = name.split('<').next().unwrap_or_default();
        let is = |(of, wanted): &(&str, &str)| file.ends_with(of) && (wanted.is_empty() || *wanted == name);
        STAGES.iter().position(|(_, functions)| functions.iter().any(is))
    };
    chain.iter().find_map(of).unwrap_or(STAGES.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_innermost_function_with_a_stage_counts() {
        let chain = |names: &[(&str, &str)]| -> Chain {
            let owned = |(place, name): &(&str, &str)| ((*place).to_owned(), (*name).to_owned());
            names.iter().map(owned).collect()
        };
        let step = (
            "/r/sim/src/lanes/runs.rs:210",
            "haptic_sim::lanes::runs::Lanes<N>::step<8, true>",
        );
        let name = |names: &[(&str, &str)]| STAGES.get(stage_of(&chain(names))).map(|(name, _)| *name);
        let moved = (
            "/r/sim/src/lanes/world.rs:9 (discriminator 2)",
            "move_on<8, true>",
        );
        let rotated = ("/r/sim/src/lanes/world.rs:9", "haptic_sim::lanes::world::rotated");
        assert_eq!(name(&[rotated, moved, step]), Some("direction and place"));
        let linear = (
            "/r/sim/src/lanes/world.rs:4",
            "haptic_sim::lanes::world::Worlds<N>::linear<8>",
        );
        assert_eq!(name(&[linear, moved, step]), Some("arm, column and vehicle"));
        let judge = ("/r/sim/src/lanes/band.rs:4", "judge<8>");
        assert_eq!(
            name(&[judge, ("/r/sim/src/lanes/ecu.rs:1", "decide<8>"), step]),
            Some("the check of the monitor's band")
        );
        assert_eq!(name(&[step]), None);
    }
}
