//! Logs of buses, whole and at their edges. The values are those that python-can 4 and cantools read in the files of
//! `tests/data/buses`, or stand in the lines themselves.
//!
//! Above 500 lines because most tests hold several formats to the same frames: split by format, no test would see that two
//! differ.

#![cfg(feature = "formats")]

use std::path::Path;

use haptic_log::bus::BusFrame;
use haptic_log::formats::dbc::{self, Signals};
use haptic_log::formats::{self, BusLog, Contents, Format, Reading, Watch};
use haptic_log::notes::Note;
use haptic_log::recording::Recording;

fn file(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/data/buses")
        .join(name);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The log of a name whose extension says what it is, of its bytes.
fn log(name: &str, bytes: Vec<u8>) -> BusLog {
    BusLog::of_bytes(bytes, Format::from_path(Path::new(name)).unwrap())
}

fn read(name: &str, meaning: &str) -> Result<Recording, String> {
    dbc::channels(&log(name, file(name)), &file(meaning), None).map_err(|e| e.to_string())
}

fn of_text(text: &str, meaning: &str) -> Result<Recording, String> {
    dbc::channels(&log("x.log", text.into()), &file(meaning), None).map_err(|e| e.to_string())
}

fn notes(recording: &Recording) -> Vec<String> {
    recording.notes.iter().map(Note::to_string).collect()
}

/// Instants and values of a channel, where it has any.
fn course(recording: &Recording, name: &str) -> Vec<(f64, f64)> {
    let (group, series) = recording.find(name).unwrap();
    let all = group.time_s.iter().copied().zip(series.values.iter().copied());
    all.filter(|(_, value)| !value.is_nan()).collect()
}

fn values(recording: &Recording, name: &str) -> Vec<f64> {
    course(recording, name)
        .into_iter()
        .map(|(_, value)| value)
        .collect()
}

fn near(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-9, "{found:?} {expected:?}");
    }
}

#[test]
fn identifiers_of_11_and_29_bits_are_told_apart() {
    // 0x10630040 without bit 31: its frames are those of 29 bits, not 040, to which 16 bits cut it.
    let found = read("nobit31.log", "nobit31.dbc").unwrap();
    near(&values(&found, "ExtAngle"), &[12.7, 12.7]);
    near(&values(&found, "StdA"), &[1.0]);
    assert_eq!(
        notes(&found),
        [
            "1 channel (EXT_STEER) guessed: an identifier above 7FF without bit 31 has 29 bits",
            "2 frames left out: no message of the DBC file, the first in line 1"
        ]
    );
    // Number 40 of 29 bits is not number 40 of 11; what stands behind other words goes with its message.
    let dbc = "VERSION \"\"\nNS_ :\nBS_:\nBU_: A\nBO_ 2048 Far: 8 A\n SG_ M0 M : 0|8@1+ (1,0) [0|0] \"\" A\n \
               SG_ V m1 : 8|32@1- (1,0) [0|0] \"\" A\nSIG_VALTYPE_ 2048 V : 1;\nSG_MUL_VAL_ 2048 V M0 2-3;\n\
               CM_ SG_ 2048 V \"a number 2048 in words\";\nVAL_ 2048 M0 1 \"one\" ;\n";
    let text = "(0.0) can0 00000800#010000803F000000\n(0.1) can0 00000800#030000803F000000\n";
    let found = dbc::channels(&log("x.log", text.into()), dbc.as_bytes(), None).unwrap();
    // 3F800000 is 1 as a float; the switch has to be 2 or 3.
    assert_eq!(course(&found, "V"), [(0.1, 1.0)]);
    // More than 29 bits are no identifier.
    let beyond = dbc.replace("2048", "1073741888");
    let error = dbc::channels(&log("x.log", text.into()), beyond.as_bytes(), None)
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("none of the 2 frames is a message of the DBC file"),
        "{error}"
    );
}

#[test]
fn a_switch_that_is_switched_is_followed() {
    let found = read("mux.log", "mux.dbc").unwrap();
    assert_eq!(course(&found, "Angle"), [(0.0, 100.0)]);
    assert_eq!(course(&found, "Torque"), [(0.02, 10.0)]);
    assert_eq!(course(&found, "Both"), [(0.02, 5.0), (0.03, 5.0)]);
    assert_eq!(values(&found, "S1"), [3.0]);
    // A switch of a switch of a switch; two that wait for each other carry nothing.
    let dbc = "VERSION \"\"\nNS_ :\nBS_:\nBU_: A\nBO_ 1 M: 8 A\n SG_ A M : 0|8@1+ (1,0) [0|0] \"\" A\n \
               SG_ B m1M : 8|8@1+ (1,0) [0|0] \"\" A\n SG_ C m1M : 16|8@1+ (1,0) [0|0] \"\" A\n \
               SG_ V m1 : 31|16@0- (1,0) [0|0] \"\" A\nSG_MUL_VAL_ 1 B A 1-1;\nSG_MUL_VAL_ 1 C B 1-1;\nSG_MUL_VAL_ 1 V C 7-9;\n";
    let text = "(0.0) can0 001#010108FFFE\n(0.1) can0 001#020108FFFE\n(0.2) can0 001#010208FFFE\n(0.3) can0 001#01010AFFFE\n";
    let read = |dbc: &str| dbc::channels(&log("x.log", text.into()), dbc.as_bytes(), None).unwrap();
    assert_eq!(course(&read(dbc), "V"), [(0.0, -2.0)]);
    let circle = dbc.replace("SG_MUL_VAL_ 1 B A 1-1;", "SG_MUL_VAL_ 1 B C 1-1;");
    assert_eq!(course(&read(&circle), "V"), []);
}

#[test]
fn every_bus_is_a_group_of_its_own() {
    for (name, buses) in [
        ("two.log", ["can0", "can2"]),
        ("two.asc", ["1", "2"]),
        ("channels.blf", ["1", "2"]),
    ] {
        let whole = read(name, "one.dbc").unwrap();
        let channel = |bus: &str| format!("{bus}.STEER.Angle");
        let (first, second) = (
            values(&whole, &channel(buses[0])),
            values(&whole, &channel(buses[1])),
        );
        near(&[first[0], first[1]], &[10.0, 10.1]);
        assert!((second[0] + 10.0).abs() < 1e-9 && first.len() == second.len());
        assert!(whole.find("Angle").is_err());
        let one = dbc::channels(
            &log(name, file(name)).of_bus(Some(buses[1])),
            &file("one.dbc"),
            None,
        )
        .unwrap();
        assert_eq!(values(&one, "STEER.Angle"), second);
        assert!(
            notes(&one).iter().any(|note| note.contains("of another bus")),
            "{:?}",
            notes(&one)
        );
        let none = dbc::channels(
            &log(name, file(name)).of_bus(Some("can7")),
            &file("one.dbc"),
            None,
        );
        let expected = format!(
            "no frame is of the bus can7; there are {}, {}",
            buses[0], buses[1]
        );
        assert_eq!(none.unwrap_err().to_string(), expected);
    }
    let found = read("dupname.log", "dupname.dbc").unwrap();
    assert_eq!(course(&found, "Wheel_0x010.Angle"), [(0.0, 10.0)]);
    assert_eq!(course(&found, "Wheel_0x011.Angle"), [(0.1, 20.0)]);
}

#[test]
fn a_stretch_of_a_log_is_cut_as_it_is_read() {
    let whole = log("two.log", file("two.log")).within(&[(0.01, 0.02), (0.05, f64::INFINITY)]);
    let found = dbc::channels(&whole, &file("one.dbc"), None).unwrap();
    let instants: Vec<f64> = course(&found, "can0.STEER.Torque")
        .into_iter()
        .map(|(time_s, _)| time_s)
        .collect();
    assert_eq!(instants, [0.01, 0.02, 0.05]);
    assert_eq!(
        notes(&found),
        ["7 frames left out: outside of the time asked for, the first in line 1"]
    );
    let none = dbc::channels(&whole.within(&[(5.0, 6.0)]), &file("one.dbc"), None);
    assert_eq!(
        none.unwrap_err().to_string(),
        "there is no frame in the stretches of --from and --to"
    );
}

/// Interfaces of other names are numbered where a format numbers its channels, and no two become one.
#[test]
fn buses_are_written_back() {
    let place = tempfile::tempdir().unwrap();
    let text = "(0.0) vcan0 001#01\n(0.1) can0 001#02\n(0.2) can4 001#03\n(0.3) can0 001#04\n";
    for extension in ["asc", "blf"] {
        let path = place.path().join(format!("x.{extension}"));
        let (count, told) = formats::write_frames(&path, &log("x.log", text.into())).unwrap();
        let Contents::Frames(again) = formats::read(&path, Reading::default(), &Watch::default()).unwrap()
        else {
            panic!("{extension}: no frames");
        };
        let (frames, _) = again.frames().unwrap();
        let buses: Vec<&str> = frames.iter().map(|frame| frame.bus.as_str()).collect();
        assert_eq!((count, &buses[..]), (4, &["1", "2", "5", "2"][..]), "{extension}");
        let told: Vec<String> = told.iter().map(Note::to_string).collect();
        assert_eq!(
            told,
            ["2 channels (vcan0 to 1, can0 to 2) converted: a bus that the format numbers"]
        );
        let back = place.path().join("x.log");
        formats::write_frames(&back, &again).unwrap();
        let back = std::fs::read_to_string(back).unwrap();
        let expected = "(0.000000) can0 001#01\n(0.100000) can1 001#02\n(0.200000) can4 001#03\n(0.300000) can1 001#04\n";
        assert_eq!(back, expected, "{extension}");
    }
}

#[test]
fn a_clock_that_does_not_go_on_is_refused_in_every_format() {
    for name in ["wrap60.log", "delta.log", "wrap.blf"] {
        let error = read(name, "one2.dbc").unwrap_err();
        assert!(error.contains("the time goes back from "), "{error}");
        let place = tempfile::tempdir().unwrap();
        assert!(formats::write_frames(&place.path().join("x.asc"), &log(name, file(name))).is_err());
    }
    let error = read("wrap60.log", "one2.dbc").unwrap_err();
    assert!(
        error.starts_with("line 7: the time goes back from 59.9 to 0 s: a clock that wrapped"),
        "{error}"
    );
    let asc = String::from_utf8(file("two.asc")).unwrap();
    let wrapped = format!(
        "{}{}",
        asc,
        asc.lines()
            .skip(5)
            .map(|line| format!("{line}\n"))
            .collect::<String>()
    );
    let error = dbc::channels(&log("x.asc", wrapped.into()), &file("one.dbc"), None)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("line 19: the time goes back from 0.05 to 0 s"),
        "{error}"
    );
    // Differences of one length stand still.
    let stands = |rows: usize, differs: bool| -> String {
        (0..rows)
            .map(|k| {
                format!(
                    "(0.010000) can0 025#{:04X}320000000000\n",
                    if differs { k } else { 0 }
                )
            })
            .collect()
    };
    let error = of_text(&stands(50, true), "one.dbc").unwrap_err();
    assert!(
        error.contains("message STEER: 49 of 50 frames have the time stamp of the frame before"),
        "{error}"
    );
    // A gateway that repeats a frame: one value, and said to be merged.
    let found = of_text(&stands(3, false), "one.dbc").unwrap();
    assert_eq!(course(&found, "Torque"), [(0.01, 0.5)]);
    assert_eq!(
        notes(&found),
        ["2 frames merged: with the stamp of the frame before, the first in line 2"]
    );
    // Two rows of a switch at one instant are no contradiction.
    let both =
        "(0.0) can0 100#30E8030500000000\n(0.0) can0 100#01E8030500000000\n(1.0) can0 100#01E8030500000000\n";
    let found = of_text(both, "mux.dbc").unwrap();
    assert_eq!(
        (course(&found, "Angle"), values(&found, "Torque")),
        (vec![(0.0, 100.0)], vec![10.0, 10.0])
    );
}

#[test]
fn one_bad_frame_refuses_nothing_but_itself() {
    let found = read("errorframe.log", "one.dbc").unwrap();
    near(&values(&found, "Angle"), &[10.0, 10.1]);
    assert_eq!(notes(&found), ["1 frame left out: error frame, in line 2"]);
    let found = read("direction.log", "one.dbc").unwrap();
    near(&values(&found, "Angle"), &[10.0, 10.1]);
    assert!(notes(&found).is_empty());
    let found = read("short.log", "one2.dbc").unwrap();
    assert_eq!(
        (values(&found, "Angle").len(), values(&found, "Other").len()),
        (5, 4)
    );
    assert_eq!(
        notes(&found),
        ["1 value left out: the frame is too short for the signal, in line 6"]
    );
    // Of two signals one is there.
    let found = of_text("(0.0) can0 025#6400\n(0.1) can0 025#64003200\n", "one.dbc").unwrap();
    assert_eq!(
        (values(&found, "Angle"), course(&found, "Torque")),
        (vec![10.0, 10.0], vec![(0.1, 0.5)])
    );
    let bad = "nonsense\n(0.0) can0 025#64003200\n(0.1) can0 025#6Z\n\u{fffd}\n(0.2) can0 025#64003200\n";
    let found = of_text(bad, "one.dbc").unwrap();
    assert_eq!(values(&found, "Angle").len(), 2);
    assert_eq!(notes(&found).len(), 2, "{:?}", notes(&found));
    let error = of_text("nonsense\n", "one.dbc").unwrap_err();
    assert_eq!(
        error,
        "line 1: no time stamp; record with candump -L: \"nonsense\""
    );
    let error = of_text("(0.1) can0 20000004#0004000000000000\n", "one.dbc").unwrap_err();
    assert_eq!(
        error,
        "there is no data frame in it (1 frame left out: error frame, in line 1)"
    );
    assert!(of_text("", "one.dbc").is_err());
}

/// python-can: 33 messages, of which one is an error and one remote; 64 bytes of CAN FD are 0 to 63.
#[test]
fn frames_of_every_kind_are_read_where_they_stand() {
    for name in ["channels.blf", "channels.asc"] {
        let (frames, told) = log(name, file(name)).frames().unwrap();
        let told: Vec<String> = told.iter().map(Note::to_string).collect();
        assert_eq!(frames.len(), 31, "{name}");
        assert_eq!(frames.iter().filter(|frame| frame.extended).count(), 10, "{name}");
        assert!(
            told[0].starts_with("1 frame left out: error frame")
                && told[1].starts_with("1 frame left out: remote")
        );
        let last = &frames[30];
        assert!(
            (last.id, last.data.len()) == (0x123, 64) && (0..64).eq(last.data.iter().copied()),
            "{name}"
        );
        let wide = "VERSION \"\"\nNS_ :\nBS_:\nBU_: A\nBO_ 291 Wide: 64 A\n SG_ Low : 484|12@1+ (1,0) [0|0] \"\" A\n \
                    SG_ High : 483|64@0+ (1,0) [0|0] \"\" A\n SG_ Last : 510|9@1+ (1,0) [0|0] \"\" A\n";
        let found = dbc::channels(&log(name, file(name)), wide.as_bytes(), None).unwrap();
        // Bytes 60 and 61 are 3C and 3D; the 64 bits from bit 3 of byte 60 on go beyond the frame, as the last signal does.
        assert_eq!(values(&found, "Low"), [f64::from(0x3D3)]);
        assert!(values(&found, "High").is_empty() && values(&found, "Last").is_empty());
        assert!(
            notes(&found)
                .iter()
                .any(|note| note.starts_with("2 values left out: the frame is too short"))
        );
    }
    let found = read("fdclassic101.blf", "one2.dbc").unwrap();
    let (frames, told) = log("x.blf", file("fdclassic101.blf")).frames().unwrap();
    assert!(
        frames
            .iter()
            .all(|frame| frame.form == haptic_log::bus::Form::Classic)
            && told.is_empty()
    );
    assert_eq!((frames.len(), values(&found, "Angle").len()), (50, 50));
    let found = read("mixed.blf", "one2.dbc").unwrap();
    assert_eq!(
        (values(&found, "Angle").len(), values(&found, "Other").len()),
        (50, 50)
    );
    // A classic frame in a line of CAN FD has not the flag 1000; with a name, and without.
    let asc = "base hex timestamps absolute\n 0.1 CANFD 1 Rx 25 Name 0 0 8 8 64 00 32 00 00 00 00 00 0 0 0 0\n \
               0.2 CANFD 1 Tx 25 1 0 8 8 65 00 32 00 00 00 00 00 0 0 3000 0\n 0.3 CANFD 1 Rx 25 0 0 8 0 0 0 10 0\n";
    let (frames, told) = log("x.asc", asc.into()).frames().unwrap();
    let forms: Vec<_> = frames
        .iter()
        .map(|frame| (frame.form.most_bytes(), frame.sent))
        .collect();
    assert_eq!(forms, [(8, false), (64, true)]);
    assert_eq!(
        told.iter().map(Note::to_string).collect::<Vec<_>>(),
        ["1 frame left out: remote frame, in line 4"]
    );
}

/// A BLF file of one object 101: so many bytes that it says, those that it has, and where it says that other things begin.
fn blf_of(id: u32, says: u8, bytes: &[u8], more: u8) -> Vec<u8> {
    let mut body = vec![7, 15, says, 0];
    body.extend(id.to_le_bytes());
    body.extend([0, 0, 0, 0, 0, 0x30, 0, 0]);
    body.resize(40, 0);
    body[35] = more;
    body.extend_from_slice(bytes);
    let mut file = b"LOGG".to_vec();
    file.push(144);
    file.resize(144, 0);
    file.extend(b"LOBJ\x20\0\x01\0");
    file.extend((32 + body.len() as u32).to_le_bytes());
    file.extend([101, 0, 0, 0, 2, 0, 0, 0]);
    file.resize(file.len() + 12, 0);
    file.extend(body);
    file
}

/// Zeros at the end of a frame may be missing: python-can fills them up as Vector's library does (its issue 1905).
#[test]
fn an_object_that_ends_before_its_frame_is_filled_up() {
    let short = blf_of(0x6A9, 64, &[0xFF; 48], 0);
    let (frames, told) = log("x.blf", short).frames().unwrap();
    let expected: Vec<u8> = [[0xFF; 48].as_slice(), &[0; 16]].concat();
    assert_eq!((frames[0].id, &frames[0].data), (0x6A9, &expected));
    let said = "1 frame mended: the object ends before the frame, whose other bytes are 0, in object 1";
    assert_eq!(told.iter().map(Note::to_string).collect::<Vec<_>>(), [said]);
    // What stands behind the bytes of a frame is none of them.
    let more = blf_of(0x6A9, 12, &[1, 2, 3, 4, 9, 9, 9, 9, 9, 9, 9, 9], 32 + 40 + 4);
    let (frames, _) = log("x.blf", more).frames().unwrap();
    assert_eq!(frames[0].data, [1, 2, 3, 4, 0, 0, 0, 0, 0, 0, 0, 0]);
    let whole = blf_of(0x6A9, 12, &[5; 12], 32 + 40 + 12);
    let (frames, told) = log("x.blf", whole).frames().unwrap();
    assert!(frames[0].data == [5; 12] && told.is_empty());
    let error = log("x.blf", blf_of(0x444_4444, 8, &[0; 8], 0))
        .frames()
        .unwrap_err();
    let said = "1 frame left out: an identifier above 7FF that has 11 bits, in object 1";
    assert!(error.to_string().contains(said), "{error}");
}

/// A frame of more than 8 bytes, or of another rate, is none of classic CAN, whatever flags say.
#[test]
fn flags_of_an_asc_file_make_no_classic_frame_of_64_bytes() {
    let wide = "01 ".repeat(64);
    let asc = format!(
        "base hex timestamps absolute\n 0.1 CANFD 1 Rx 25 0 0 f 64 {wide}133 11 0 46\n \
         0.2 CANFD 1 Rx 25 1 0 2 2 01 02 133 11 0 46\n 0.3 CANFD 1 Rx 25 0 0 2 2 01 02 133 11 0 46\n"
    );
    let (frames, told) = log("x.asc", asc.into()).frames().unwrap();
    let forms = frames
        .iter()
        .map(|frame| (frame.form.most_bytes(), frame.data.len()));
    assert_eq!(forms.collect::<Vec<_>>(), [(64, 64), (64, 2), (8, 2)]);
    let said = "2 frames guessed: CAN FD by its bytes or bits, and not by its flags, the first in line 2";
    assert_eq!(told.iter().map(Note::to_string).collect::<Vec<_>>(), [said]);
}

/// Names that a tool cut to 32 characters: one number each, and none is lost.
#[test]
fn signals_of_one_name_in_a_message_are_told_apart() {
    let dbc = "VERSION \"\"\nNS_ :\nBS_:\nBU_: A\nBO_ 37 M: 8 A\n SG_ Lock : 0|8@1+ (1,0) [0|0] \"\" A\n \
               SG_ Lock_2 : 8|8@1+ (1,0) [0|0] \"\" A\n SG_ Lock : 16|8@1+ (1,0) [0|0] \"\" A\n";
    let text = "(0.0) can0 025#0A0B0C0000000000\n";
    let found = dbc::channels(&log("x.log", text.into()), dbc.as_bytes(), None).unwrap();
    for (name, value) in [("Lock_1", 10.0), ("Lock_2", 11.0), ("Lock_2_", 12.0)] {
        assert_eq!(values(&found, name), [value], "{name}");
    }
    let said =
        "2 channels (Lock to Lock_1, Lock to Lock_2_) converted: another signal of the message has its name";
    assert_eq!(notes(&found), [said]);
}

/// A DBC file of which no message is understood is one sentence with the place of the first mistake.
#[test]
fn a_dbc_file_without_a_message_is_refused_with_its_line() {
    let dbc = "VERSION \"\"\nNS_ :\nBS_:\nBU_: A\n\nBA_DEF_ BO_ \"Send\" ENUM;\n";
    let error = dbc::parse(dbc.as_bytes()).unwrap_err().to_string();
    assert!(
        error.starts_with("the DBC file is not understood: line 6, column "),
        "{error}"
    );
    assert!(!error.contains('\n') && error.contains("expected"), "{error}");
    for text in ["", "nonsense", "\"", "BO_ 37 M; 8 A\n SG_ A"] {
        let none = dbc::channels(
            &log("x.log", b"(0.0) can0 025#64\n".to_vec()),
            text.as_bytes(),
            None,
        );
        assert!(none.is_err(), "{text:?}");
    }
}

/// Three frames, read by a DBC file of six lines and what follows.
fn beside_two_messages(body: &str) -> Recording {
    let begin = "\u{feff}VERSION \"\"\nNS_ :\n\tCM_\n\tBO_TX_BU_\nBS_:\nBU_: A\n";
    let text = "(0.0) can0 025#6432\n(0.1) can0 026#64\n(0.2) can0 025#6432\n";
    let dbc_text = format!("{begin}{body}");
    dbc::channels(&log("x.log", text.into()), dbc_text.as_bytes(), None).unwrap()
}

/// What is wrong in a DBC file takes no other message along: a byte of 0x64 is 100 for those that are left.
#[test]
fn a_statement_that_is_not_understood_takes_nothing_else_along() {
    let signals = " SG_ V : 0|8@1+ (1,0) [0|0] \"\" A\n SG_ W : 8|8@1+ (1,0) [0|0] \"\" A\n";
    let (first, second) = (
        format!("BO_ 37 M: 8 A\n{signals}"),
        "BO_ 38 N: 8 A\n SG_ X : 0|8@1+ (1,0) [0|0] \"\" A\n",
    );
    let whole = beside_two_messages(&format!("{first}{second}"));
    assert!(whole.notes.is_empty());
    assert_eq!(values(&whole, "V"), [100.0, 100.0]);
    let not = "the DBC file's text is not understood";
    let statement = |line: usize| format!("1 statement left out: {not}, in line {line}");
    let channel = |name: &str| format!("1 channel ({name}) left out: {not}");
    // What is wrong, what is said, and what is left of V, W and X.
    let is = [
        [true, true, true],
        [false, true, true],
        [false, false, true],
        [true, true, false],
    ];
    for (body, said, left) in [
        (
            format!("{first}{second}BA_DEF_ BO_ \"Send\" ENUM;\n"),
            statement(12),
            is[0],
        ),
        (format!("BU_SG_ nothing\n{first}{second}"), statement(7), is[0]),
        // An open quote, behind which an odd number of them stands.
        (format!("CM_ \"open\n{first}{second}"), statement(7), is[0]),
        (
            format!("{first}CM_ \"a\nBO_ 9 x\";;\n{second}"),
            statement(10),
            is[0],
        ),
        (
            format!("{first}{second}").replacen("0|8@1+ (1,0)", "0|8@1+ (1;0)", 1),
            channel("V"),
            is[1],
        ),
        (
            format!("{first}{second}").replacen("SG_ V :", "SG_ V:0|", 1),
            channel("V"),
            is[1],
        ),
        (
            format!("{first}{second}SIG_VALTYPE_ 37 V : 7;\n"),
            channel("V"),
            is[1],
        ),
        (
            format!("{first}{second}SG_MUL_VAL_ 38 X V 1;\n"),
            channel("X"),
            is[3],
        ),
        (
            format!("{first}{second}").replace("BO_ 37", "BO_ -37"),
            channel("M"),
            is[2],
        ),
        (
            format!("{first}{second}").replace("BO_ 38", "BO_ 4294967296"),
            channel("N"),
            is[3],
        ),
        (
            format!("{first}{second}").replacen("(1,0)", "(1e400,0)", 1),
            "1 channel (V) left out: its factor or offset is beyond all numbers".into(),
            is[1],
        ),
    ] {
        let found = beside_two_messages(&body);
        assert!(notes(&found).contains(&said), "{body}: {:?}", notes(&found));
        for (name, is_left) in ["V", "W", "X"].into_iter().zip(left) {
            assert_eq!(found.find(name).is_ok(), is_left, "{body}: {name}");
        }
        if left[1] {
            assert_eq!(values(&found, "W"), [50.0, 50.0], "{body}");
        }
        if left[2] {
            assert_eq!(values(&found, "X"), [100.0], "{body}");
        }
    }
}

/// python-can reads 1992 of 3000 frames. Cut at any other place the file is read as far as it goes, and says so.
#[test]
fn a_cut_file_is_read_to_the_cut() {
    let found = read("cut.blf", "one2.dbc").unwrap();
    assert_eq!(values(&found, "Angle").len(), 1992);
    assert!(
        notes(&found)[0].contains("objects cut: the file is cut or damaged"),
        "{:?}",
        notes(&found)
    );
    let whole = file("channels.blf");
    // At least what python-can reads of so many bytes, and nothing that is not there.
    let (all, _) = log("x.blf", whole.clone()).frames().unwrap();
    for (length, least) in [(300, 10), (400, 21), (450, 27), (500, 30), (580, 30), (588, 31)] {
        let (frames, told) = log("x.blf", whole[..length].to_vec()).frames().unwrap();
        assert!(
            frames.len() >= least && frames[..] == all[..frames.len()],
            "{length}: {}",
            frames.len()
        );
        assert_eq!(
            told.iter().any(|note| note.to_string().contains("cut")),
            length < 588,
            "{length}"
        );
    }
    // The first of two containers is damaged: the second is read.
    let (mut two, second) = (whole, file("fdclassic101.blf"));
    two[176] ^= 0xFF;
    two.extend_from_slice(&second[144..]);
    let (frames, told) = log("x.blf", two).frames().unwrap();
    let (expected, _) = log("x.blf", second).frames().unwrap();
    assert_eq!(frames, expected);
    assert!(
        told.iter()
            .any(|note| note.to_string().contains("the file is cut or damaged"))
    );
}

#[test]
fn lengths_commas_and_encodings_of_others_are_read() {
    let found = read("dlc.asc", "one.dbc").unwrap();
    near(&values(&found, "Angle"), &[10.0, 10.1]);
    let (frames, _) = log("dlc.asc", file("dlc.asc")).frames().unwrap();
    assert_eq!(frames[1].data, [0x55, 0xAA, 1, 2, 3, 4, 5, 6]);
    let found = read("comma.asc", "one.dbc").unwrap();
    assert_eq!(course(&found, "Torque"), [(0.0, 0.5), (0.02, 0.5)]);
    assert_eq!(
        notes(&found),
        ["2 time stamps converted: decimal comma, the first in line 6"]
    );
    // Differences as the heading says them, in decimal digits.
    let asc = "base dec timestamps relative\n0,5 1 37 Rx d 8 100 0 50 0 0 0 0 0\n0,5 1 Statistic: D 1\n0,5 1 37 Rx d 9 101 0 50 0 0 0 0 0\n";
    let found = dbc::channels(&log("x.asc", asc.into()), &file("one.dbc"), None).unwrap();
    near(&values(&found, "Angle"), &[10.0, 10.1]);
    assert_eq!(course(&found, "Torque"), [(0.5, 0.5), (1.5, 0.5)]);
    let found = read("two.log", "cp1252.dbc").unwrap();
    assert_eq!(found.find("can0.STEER.Angle").unwrap().1.unit, "\u{b0}");
}

/// Bus logging in MDF 4 as python-can writes it through asammdf: the same frames as in the other formats.
#[test]
fn bus_logging_in_mdf_is_read_with_a_dbc_file() {
    let Ok(Contents::Frames(log)) =
        formats::read_bytes(file("channels.mf4"), Format::Mdf4, Reading::default())
    else {
        panic!("no frames");
    };
    let (frames, told) = log.frames().unwrap();
    let (expected, _) = self::log("x.blf", file("channels.blf")).frames().unwrap();
    let plain = |f: &BusFrame| (f.id, f.extended, f.form, f.data.clone());
    assert!(frames.iter().map(plain).eq(expected.iter().map(plain)));
    assert!(
        told.iter()
            .any(|note| note.to_string().starts_with("1 frame left out: remote frame"))
    );
    let found = dbc::channels(&log, &file("one.dbc"), None).unwrap();
    near(&values(&found, "0.STEER.Angle")[..2], &[10.0, 10.1]);
    near(&values(&found, "1.STEER.Angle")[..2], &[-10.0, -10.1]);
    let one = dbc::channels(&log.of_bus(Some("1")), &file("one.dbc"), None).unwrap();
    assert_eq!(values(&one, "Torque").len(), 10);
}

/// What is written row by row is what the whole table is, and the list of channels is that of the whole.
#[test]
fn a_log_is_the_same_flat_as_whole() {
    let place = tempfile::tempdir().unwrap();
    let logs = [
        "two.log",
        "channels.blf",
        "short.log",
        "mux.log",
        "dupname.log",
        "mixed.blf",
    ];
    let meanings = [
        "one.dbc",
        "one2.dbc",
        "one2.dbc",
        "mux.dbc",
        "dupname.dbc",
        "one2.dbc",
    ];
    for (name, meaning) in logs.into_iter().zip(meanings) {
        let whole = read(name, meaning).unwrap();
        let log = log(name, file(name));
        let signals = Signals::of(&log, &file(meaning)).unwrap();
        assert_eq!(signals.notes, whole.notes, "{name}");
        assert_eq!(signals.table(), whole.table(), "{name}");
        let grids = [None, Some(0.005)].map(|longest_s| {
            let [flat, whole] = [
                signals.resampled(250.0, longest_s),
                whole.resampled(250.0, longest_s),
            ];
            let text = |group| format!("{group:?}");
            (
                flat.map(text).map_err(|e| e.to_string()),
                whole.map(text).map_err(|e| e.to_string()),
            )
        });
        assert!(
            grids.iter().all(|(flat, whole)| flat == whole),
            "{name}: {grids:?}"
        );
        let mut flat = Vec::new();
        signals.write_csv(&mut flat).unwrap();
        let path = place.path().join("x.csv");
        formats::write(&path, whole).unwrap();
        assert_eq!(
            String::from_utf8(flat).unwrap(),
            std::fs::read_to_string(path).unwrap(),
            "{name}"
        );
    }
}

/// Big-endian and signed, as in the example of Vector's DBC format: a 12-bit number that begins at bit 3 of byte 0
/// (start 3, Motorola) in 0A BC is ABC; signed it is ABC - 1000 in hexadecimal.
#[test]
fn signals_of_both_byte_orders_are_decoded() {
    let dbc = "VERSION \"\"\n\nBU_: A\n\nBO_ 256 M: 8 A\n SG_ Big : 3|12@0+ (1,0) [0|0] \"\" A\n \
               SG_ Signed : 3|12@0- (0.5,1) [0|0] \"deg\" A\n SG_ Little : 16|16@1- (1,0) [0|0] \"\" A\n";
    let found = dbc::channels(
        &log("x.log", "(0.5) can0 100#0ABCFEFF\n".into()),
        dbc.as_bytes(),
        None,
    )
    .unwrap();
    let values: Vec<f64> = found.groups[0].channels.iter().map(|c| c.values[0]).collect();
    assert_eq!(
        values,
        [f64::from(0xABC), 0.5 * f64::from(0xABC - 0x1000) + 1.0, -2.0]
    );
    assert_eq!(found.groups[0].channels[1].unit, "deg");
}
