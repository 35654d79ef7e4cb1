//! SLCAN lines as the Lawicel manual writes them.

use haptic_core::bus::Frame;
use haptic_core::bus::slcan::{Line, Parser, format};

fn lines(text: &str) -> Vec<Line> {
    let mut parser = Parser::default();
    text.bytes().filter_map(|byte| parser.push(byte)).collect()
}

#[test]
fn frames_both_ways() {
    let frame = Frame::new(0x123, &[0x45, 0x67, 0x89, 0xAB]).unwrap();
    assert_eq!(
        lines("t123445678 9AB\r".replace(' ', "").as_str()),
        [Line::Frame(frame)]
    );
    assert_eq!(format(&frame), b"t1234456789AB\r");
    assert_eq!(
        lines("t12344567 89ab\r".replace(' ', "").as_str()),
        [Line::Frame(frame)]
    );
    let empty = Frame::new(0x7FF, &[]).unwrap();
    assert_eq!(lines("t7FF0\r"), [Line::Frame(empty)]);
    assert_eq!(format(&empty), b"t7FF0\r");
}

#[test]
fn commands_of_python_can_and_slcand() {
    assert_eq!(
        lines("\rC\rS6\rO\r"),
        [Line::Empty, Line::Close, Line::Setting, Line::Open]
    );
    assert_eq!(lines("V\rN\rF\r"), [Line::Version, Line::Serial, Line::Flags]);
}

#[test]
fn nonsense_is_invalid_and_the_next_line_is_good() {
    for bad in [
        "t8001",
        "t1239",
        "t12310",
        "t1231000",
        "t12g0",
        "T000001230",
        "r1230",
        "S9",
        "x",
        "t123812345678901234567890123456789012345",
        "t",
        "t12",
        "tg230",
        "t1g30",
        "t123g",
        "t1231g0",
        "t12310g",
        // Nine bytes, all there.
        "t1239001122334455667788",
    ] {
        assert_eq!(
            lines(&format!("{bad}\rO\r")),
            [Line::Invalid, Line::Open],
            "{bad}"
        );
    }
}

/// Some clients end a line with both characters; what is too long is no line, whatever it begins with.
#[test]
fn a_line_feed_belongs_to_no_line_and_too_much_is_none() {
    let mut parser = Parser::default();
    let mut lines = |text: &str| -> Vec<Line> { text.bytes().filter_map(|byte| parser.push(byte)).collect() };
    assert_eq!(lines("C\r\nO\r\n"), [Line::Close, Line::Open]);
    let long = format!("s{}\r", "0".repeat(60));
    assert_eq!(lines(&long), [Line::Invalid]);
    assert_eq!(lines("O\r"), [Line::Open]);
}
