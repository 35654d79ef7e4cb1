//! What is nested deeper than a stack is high: refused or read, and the process lives.

use haptic_log::formats::{BusLog, Format, Reading, read_bytes};
use haptic_log::notes::{Fate, Notes};
use haptic_sim::models::road::{Course, LaneChoice};

use crate::seeds;

const DEEP: usize = 200_000;

#[test]
fn a_road_is_nested() {
    let text = format!(
        "<OpenDRIVE>{}{}</OpenDRIVE>",
        "<a>".repeat(DEEP),
        "</a>".repeat(DEEP)
    );
    let error = Course::from_opendrive("nested", &text, &LaneChoice::default()).unwrap_err();
    assert!(error.to_string().contains("it has no <road>"), "{error}");
}

#[test]
fn a_scenario_is_nested() {
    let text = format!("speed_m_per_s = {}16{}", "[".repeat(DEEP), "]".repeat(DEEP));
    assert!(Course::from_toml("nested", &text).is_err());
    let text = format!("{}speed_m_per_s = 1", "a.".repeat(DEEP));
    assert!(Course::from_toml("nested", &text).is_err());
}

/// The signal that it is in is left out, and said; its neighbour is read.
#[test]
fn a_dbc_file_is_nested() {
    let text = seeds::SMALL_DBC.replace("(0.001,", &"(".repeat(DEEP));
    let log = BusLog::of_frames(seeds::frames(4), Notes::default());
    let found = haptic_log::formats::dbc::channels(&log, text.as_bytes(), None).unwrap();
    let channels: Vec<&str> = found
        .groups
        .iter()
        .flat_map(|group| &group.channels)
        .map(|channel| channel.name.as_str())
        .collect();
    assert!(
        channels.contains(&"Heading") && !channels.contains(&"Offset"),
        "{channels:?}"
    );
    assert!(found.notes.iter().any(|note| note.fate == Fate::LeftOut));
}

/// Lists of data blocks, each with one link, to the next list.
#[test]
fn the_data_of_an_mdf_file_are_nested() {
    let mut file = seeds::table("mf4").remove(0);
    let number = |file: &[u8], at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap());
    let group = number(&file, 64 + 24) as usize;
    let data = group + 24 + 2 * 8;
    let mut inner = number(&file, data);
    for _ in 0..DEEP {
        let at = file.len() as u64;
        file.extend(b"##DL\0\0\0\0");
        for value in [40, 2, 0, inner] {
            file.extend(value.to_le_bytes());
        }
        inner = at;
    }
    file[data..data + 8].copy_from_slice(&inner.to_le_bytes());
    let error = read_bytes(file, Format::Mdf4, Reading::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("nested"), "{error}");
}

/// A schema of groups of one group each, as its list of elements says it in Thrift's compact protocol.
#[test]
fn the_schema_of_a_parquet_file_is_nested() {
    let mut footer = vec![0x15, 0x02, 0x19, 0xFC];
    let mut count = DEEP as u64 + 1;
    while count > 0x7F {
        footer.push(count as u8 | 0x80);
        count >>= 7;
    }
    footer.push(count as u8);
    // Required, named a, of one child; then a leaf of 32 bits.
    footer.extend([0x35, 0, 0x18, 1, b'a', 0x15, 2, 0].repeat(DEEP));
    footer.extend([0x15, 2, 0x25, 0, 0x18, 1, b'b', 0]);
    footer.extend([0x16, 0, 0x19, 0x0C, 0]);
    let size = footer.len() as u32;
    let file = [&b"PAR1"[..], &footer, &size.to_le_bytes(), b"PAR1"].concat();
    assert!(read_bytes(file, Format::Parquet, Reading::default()).is_err());
}
