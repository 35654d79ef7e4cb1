//! The shipping ECU on a recorded bus, for the comparison of all doors (`cargo xtask bindings-agree`).

use std::fmt::Write;

use haptic_core::bus::Frame;
use haptic_core::bus::messages::is_input;
use haptic_core::controller::config::Setup;
use haptic_core::ecu::Ecu;
use haptic_core::quantity::Instant;

use crate::LabResult;

/// Lines of `t_us id data` in order of time; what the ECU sends, in the same form, a step for each time.
pub(crate) fn replay(bus: &str) -> LabResult<String> {
    let mut ecu = Ecu::engaged(&Setup::PAPER, Instant::from_us(0));
    let mut sent = String::new();
    let mut lines = bus.lines().peekable();
    while let Some(first) = lines.peek() {
        let t_us = time(first).ok_or_else(|| format!("{first}: no time"))?;
        let now = Instant::from_us(t_us as u32);
        while let Some(line) = lines.next_if(|line| time(line) == Some(t_us)) {
            let frame = frame(line)?;
            if is_input(frame.id()) {
                ecu.receive(&frame, now)
                    .map_err(|why| format!("{line}: {why:?}"))?;
            }
        }
        let step = ecu.step(now);
        for frame in std::iter::once(step.guidance)
            .chain(step.others)
            .chain(ecu.background_step())
        {
            // Writing to a string does not fail.
            let _ = write!(sent, "{t_us} {:03X} ", frame.id());
            for byte in frame.data() {
                let _ = write!(sent, "{byte:02X}");
            }
            sent.push('\n');
        }
    }
    Ok(sent)
}

fn time(line: &str) -> Option<u64> {
    line.split(' ').next()?.parse().ok()
}

fn frame(line: &str) -> LabResult<Frame> {
    let refuse = || format!("{line}: no frame");
    let mut words = line.split(' ').skip(1);
    let (id, data) = words.next().zip(words.next()).ok_or_else(refuse)?;
    let id = u16::from_str_radix(id, 16).map_err(|_| refuse())?;
    let bytes: Option<Vec<u8>> = data
        .as_bytes()
        .chunks(2)
        .map(|pair| u8::from_str_radix(str::from_utf8(pair).ok()?, 16).ok())
        .collect();
    Ok(Frame::new(id, &bytes.ok_or_else(refuse)?).ok_or_else(refuse)?)
}
