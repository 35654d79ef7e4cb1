//! Files that lie: every reader takes any bytes without a panic, and with less than 512 MB of memory.
//!
//! A seeded generator breaks good files: bits, numbers, lines, lengths, pieces of other files. An input is known by its reader
//! and its number, so that a find comes back. Five hundred inputs each by default; more by hand:
//!
//! ```text
//! HAPTIC_FUZZ_INPUTS=1000000 HAPTIC_FUZZ_SEED=7 cargo test -p haptic-guidance --test fuzz_readers parquet
//! HAPTIC_FUZZ_ONLY=4711 cargo test -p haptic-guidance --test fuzz_readers parquet
//! ```
//!
//! The second one runs a single input, and leaves it in the directory for temporary files. An input that asks for more memory
//! ends the process with its reader and number. MCAP is written and not read, so there is nothing to break.

mod memory;
mod mutate;
mod nested;
mod seeds;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

use haptic_analysis::identify::{HAPTIC_DBC, Recording as How, of_bytes};
use haptic_batch::sweep::Sweep;
use haptic_log::formats::{self, BusLog, Contents, Format, Reading};
use haptic_log::notes::Notes;
use haptic_log::recording::Recording;
use haptic_log::trace::Trace;
use haptic_sim::input::InputError;
use haptic_sim::models::road::{Course, LaneChoice};
use haptic_sim::scenario::Scenario;
use memory::Limited;

#[global_allocator]
static MEMORY: Limited = Limited;

/// What a reader may use, bytes.
const LIMIT: usize = 512 << 20;

fn variable(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(
        text.parse()
            .unwrap_or_else(|_| panic!("{name} = {text} is no number")),
    )
}

thread_local! {
    /// Where the thread's last panic was, and what it said.
    static PANIC: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Panics are kept for the one who asks. Those of a library that a reader guards are the answer "the file is damaged".
fn keep_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let usual = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            let place = info.location().map(ToString::to_string).unwrap_or_default();
            if haptic_log::guard::is_guarded() && place.contains("/registry/") {
                return;
            }
            if memory::watched() {
                let what = info.payload_as_str().unwrap_or_default();
                PANIC.with_borrow_mut(|kept| *kept = Some(format!("{place}: {what}")));
            } else {
                usual(info);
            }
        }));
    });
}

/// Breaks the seeds of a reader and reads what comes of it.
fn fuzz(reader: &'static str, seeds: &[Vec<u8>], packed: fn(Vec<u8>) -> Vec<u8>, read: impl Fn(&[u8], u64)) {
    keep_panics();
    let seed = variable("HAPTIC_FUZZ_SEED").unwrap_or(1);
    let only = variable("HAPTIC_FUZZ_ONLY");
    let numbers = match only {
        Some(number) => number..number + 1,
        None => 0..variable("HAPTIC_FUZZ_INPUTS").unwrap_or(500),
    };
    let mut finds = BTreeMap::new();
    for number in numbers {
        let bytes = packed(mutate::input(seeds, reader, seed, number));
        if only.is_some() {
            let path = std::env::temp_dir().join(format!("fuzz-{reader}-{number}"));
            std::fs::write(&path, &bytes).unwrap();
            println!("{}", path.display());
        }
        memory::watch(reader, number, LIMIT);
        let caught = panic::catch_unwind(AssertUnwindSafe(|| read(&bytes, number)));
        memory::unwatch();
        let kept = PANIC.with_borrow_mut(Option::take);
        assert!(kept.is_some() || caught.is_ok());
        if let Some(panic) = kept {
            finds.entry(panic).or_insert(number);
        }
    }
    assert!(
        finds.is_empty(),
        "{reader}: panics and the first input of each: {finds:#?}"
    );
}

fn as_it_is(bytes: Vec<u8>) -> Vec<u8> {
    bytes
}

/// All that a command makes of a table of channels. What takes many times as long as reading is done less often.
fn use_channels(recording: &Recording, number: u64) {
    let _ = recording.table();
    let _ = recording.resampled(if number.is_multiple_of(8) { 1000.0 } else { 1.0 }, None);
    let _ = recording.clone().into_one_group();
}

/// Reads a recording as `convert` and as `identify` do.
fn read_recording(bytes: &[u8], number: u64, format: Format, dbc: &str) {
    match formats::read_bytes(bytes.to_vec(), format, Reading::default()) {
        Ok(Contents::Channels(recording)) => use_channels(&recording, number),
        Ok(Contents::Frames(log)) => {
            if let Ok(recording) = formats::dbc::channels(&log, dbc.as_bytes(), None) {
                use_channels(&recording, number);
            }
            if let Err(error) = log.each(&mut |_| Ok(())) {
                assert!(!error.to_string().contains('\n'), "one sentence: {error}");
            }
        }
        Err(error) => assert!(!error.to_string().contains('\n'), "one sentence: {error}"),
    }
    // A fit, and the product's own bus, take long: less often.
    if number.is_multiple_of(if format.holds_frames() { 32 } else { 8 }) {
        let stretches = [(number as f64 % 20.0, f64::INFINITY)];
        let how = How {
            manual: number.is_multiple_of(64),
            stretches: if number.is_multiple_of(3) { &stretches } else { &[] },
            ..How::default()
        };
        let _ = of_bytes(bytes.to_vec(), Some(format), None, &[], &how);
    }
}

fn recording(reader: &'static str, seeds: &[Vec<u8>], packed: fn(Vec<u8>) -> Vec<u8>, format: Format) {
    let read = |bytes: &[u8], number: u64| read_recording(bytes, number, format, seeds::SMALL_DBC);
    fuzz(reader, seeds, packed, read);
}

#[test]
fn csv() {
    fuzz("csv", &seeds::csv(), as_it_is, |bytes, number| {
        read_recording(bytes, number, Format::Csv, "");
        if number % 8 == 1 {
            let _ = of_bytes(bytes.to_vec(), None, None, &[], &How::default());
        }
        let _ = Trace::read_csv(bytes);
    });
}

#[test]
fn candump() {
    recording("candump", &seeds::bus("log"), as_it_is, Format::Candump);
}

#[test]
fn asc() {
    recording("asc", &seeds::bus("asc"), as_it_is, Format::Asc);
}

#[test]
fn blf() {
    recording("blf", &seeds::blf_objects(), seeds::blf_file, Format::Blf);
    recording("blf as it is", &seeds::bus("blf"), as_it_is, Format::Blf);
}

#[test]
fn mat() {
    recording("mat", &seeds::table("mat"), as_it_is, Format::Mat);
    recording(
        "mat, compressed",
        &seeds::table("mat"),
        seeds::compressed_mat,
        Format::Mat,
    );
}

#[test]
fn mdf4() {
    recording("mdf4", &seeds::table("mf4"), as_it_is, Format::Mdf4);
}

#[test]
fn parquet() {
    recording("parquet", &seeds::parquet(), as_it_is, Format::Parquet);
}

#[test]
fn dbc() {
    let log = BusLog::of_frames(seeds::frames(40), Notes::default());
    fuzz("dbc", &seeds::dbc(), as_it_is, |bytes, number| {
        if let Ok(recording) = formats::dbc::channels(&log, bytes, None) {
            use_channels(&recording, number);
        }
    });
}

#[test]
fn toml() {
    let none = |course: &str, _: &LaneChoice| Err(InputError::new(course, "there is no file"));
    fuzz("toml", &seeds::toml(), as_it_is, |bytes, _| {
        let text = String::from_utf8_lossy(bytes);
        if let Ok(scenario) = Scenario::from_toml("fuzz", &text, none) {
            let _ = scenario.check_times();
            let _ = scenario.course().centreline();
            let again = Scenario::from_toml("fuzz", &scenario.to_toml(), none).expect("what it writes");
            assert_eq!(again.to_toml(), scenario.to_toml());
        }
        if let Ok(course) = Course::from_toml("fuzz", &text) {
            let _ = course.centreline();
        }
        let _ = Sweep::from_text("fuzz", &text);
    });
}

#[test]
fn opendrive() {
    fuzz("opendrive", &seeds::opendrive(), as_it_is, |bytes, number| {
        let choice = LaneChoice {
            road: (number % 2 == 0).then(|| "1".into()),
            lane: None,
            turns: if number % 8 == 0 {
                vec!["2".into()]
            } else {
                Vec::new()
            },
        };
        if let Ok(course) = Course::from_opendrive("fuzz", &String::from_utf8_lossy(bytes), &choice) {
            let _ = haptic_batch::course::survey(&course);
        }
    });
}

/// Good files are read: what is broken is not broken from the start.
#[test]
fn the_seeds_are_good() {
    let how = How::default();
    for (format, seeds) in [
        (Format::Csv, seeds::csv()),
        (Format::Mat, seeds::table("mat")),
        (Format::Mdf4, seeds::table("mf4")),
        (Format::Parquet, seeds::parquet()),
    ] {
        assert!(
            of_bytes(seeds[0].clone(), Some(format), None, &[], &how).is_ok(),
            "{format:?}"
        );
    }
    for (format, seeds) in [
        (Format::Candump, seeds::bus("log")),
        (Format::Asc, seeds::bus("asc")),
        (Format::Blf, seeds::bus("blf")),
    ] {
        let whole = seeds.last().unwrap().clone();
        of_bytes(whole, Some(format), None, &[], &How { manual: true, ..how }).expect("a drive");
    }
    for bytes in seeds::blf_objects() {
        let log = BusLog::of_bytes(seeds::blf_file(bytes), Format::Blf);
        assert!(log.frames().is_ok_and(|(frames, _)| !frames.is_empty()));
    }
    let compressed = seeds::compressed_mat(seeds::table("mat").remove(0));
    assert!(of_bytes(compressed, Some(Format::Mat), None, &[], &how).is_ok());
    assert!(
        formats::dbc::channels(
            &BusLog::of_frames(seeds::frames(40), Notes::default()),
            HAPTIC_DBC.as_bytes(),
            None
        )
        .is_ok()
    );
    for text in seeds::opendrive() {
        let text = String::from_utf8(text).unwrap();
        let choice = LaneChoice {
            road: None,
            ..LaneChoice::default()
        };
        assert!(Course::from_opendrive("seed", &text, &choice).is_ok(), "{text}");
    }
}
