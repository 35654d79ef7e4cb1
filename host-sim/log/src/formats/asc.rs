//! Vector's ASC: `   1.000000 1  100             Rx   d 8 01 02 03 04 05 06 07 08`.
//!
//! Read are data frames of classic CAN, in hexadecimal or decimal, with absolute or relative time stamps; times stay as
//! they stand. Passed over are error, remote and FD frames, and events of other kinds. Written are frames in hexadecimal;
//! stamps since 1970 are written from the first frame's second on, which the heading's date holds.

use std::fmt::Write;

use super::calendar;
use crate::candump::CandumpFrame;
use crate::recording::RecordingError;

/// Every data frame of classic CAN.
///
/// # Errors
/// A frame whose identifier or data cannot be read, with its line; no frame at all.
pub fn parse(text: &str) -> Result<Vec<CandumpFrame>, RecordingError> {
    let (mut base, mut relative, mut now_s, mut began) = (16, false, 0.0, false);
    let mut frames = Vec::new();
    for (line, content) in (1..).zip(text.lines()) {
        let words: Vec<&str> = content.split_whitespace().collect();
        let is =
            |place: usize, word: &str| words.get(place).is_some_and(|own| own.eq_ignore_ascii_case(word));
        if is(0, "base") {
            base = if is(1, "dec") { 10 } else { 16 };
            relative = is(3, "relative");
            began = true;
            continue;
        }
        began |= is(0, "date");
        // Time, channel, identifier, direction, kind, length, data.
        let time_s = words.first().and_then(|word| word.parse::<f64>().ok());
        let Some(time_s) = time_s.filter(|t| t.is_finite()) else {
            continue;
        };
        now_s = if relative { now_s + time_s } else { time_s };
        let [_, channel, id, _, kind, length, data @ ..] = &words[..] else {
            continue;
        };
        if channel.parse::<u32>().is_err() || !kind.eq_ignore_ascii_case("d") {
            continue;
        }
        let refuse = |what: &str| RecordingError(format!("line {line}: {what}: {:?}", content.trim()));
        let (id, extended) = match id.strip_suffix(['x', 'X']) {
            Some(id) => (id, true),
            None => (*id, false),
        };
        let id = u32::from_str_radix(id, base).map_err(|_| refuse("no identifier"))?;
        let length = usize::from_str_radix(length, base).ok().filter(|n| *n <= 8);
        let length = length.ok_or_else(|| refuse("no length"))?;
        let bytes = data.iter().take(length).map(|d| u8::from_str_radix(d, base).ok());
        let data = bytes
            .collect::<Option<Vec<u8>>>()
            .filter(|data| data.len() == length);
        let data = data.ok_or_else(|| refuse("not as many bytes as it says"))?;
        frames.push(CandumpFrame {
            line,
            time_s: now_s,
            id,
            extended: extended || id > 0x7FF,
            data,
        });
    }
    if !began && frames.is_empty() {
        return Err(RecordingError(
            "this is no ASC file: there is neither a date nor a base nor a frame".into(),
        ));
    }
    Ok(frames)
}

pub(super) fn write(frames: &[CandumpFrame]) -> Vec<u8> {
    const MONTHS: [&str; 12] = [
        "Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec",
    ];
    const DAYS: [&str; 7] = ["Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"];
    // Stamps of a run begin at zero and stay as they are.
    let start_s = match frames.first() {
        Some(frame) if frame.time_s > 1e8 => frame.time_s.floor(),
        _ => 0.0,
    };
    let [year, month, weekday, day, hour, minute, second, ms] = calendar::date((start_s * 1e3) as u64);
    let half = if hour < 12 { "am" } else { "pm" };
    let date = format!(
        "{} {} {day} {:02}:{minute:02}:{second:02}.{ms:03} {half} {year}",
        DAYS[usize::from(weekday)],
        MONTHS[usize::from(month) - 1],
        (hour + 11) % 12 + 1,
    );
    let mut text = format!("date {date}\nbase hex  timestamps absolute\ninternal events logged\n");
    // Writing to a string does not fail.
    let _ = writeln!(
        text,
        "Begin Triggerblock {date}\n   0.000000 Start of measurement"
    );
    for frame in frames {
        let id = format!("{:X}{}", frame.id, if frame.extended { "x" } else { "" });
        let bytes: Vec<String> = frame.data.iter().map(|byte| format!("{byte:02X}")).collect();
        let _ = writeln!(
            text,
            "{:11.6} 1  {id:<15} Rx   d {:x} {}",
            frame.time_s - start_s,
            frame.data.len(),
            bytes.join(" ")
        );
    }
    text.push_str("End TriggerBlock\n");
    text.into_bytes()
}
