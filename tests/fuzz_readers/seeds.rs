//! Good files of every kind, small where that tells as much. The last of a list is the longest.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use haptic_analysis::identify::HAPTIC_DBC;
use haptic_log::bus::BusFrame;
use haptic_log::formats::{self, BusLog};
use haptic_log::notes::Notes;
use haptic_log::recording::{Group, Recording, Series};
use haptic_log::trace::{Sample, Trace};
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::{Action, Scenario, Simulation};

/// A bus of which a frame has floats, signs, both byte orders and a multiplexer.
pub(crate) const SMALL_DBC: &str = "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: A B\n\n\
    BO_ 256 Lane: 8 A\n SG_ Offset : 0|16@1- (0.001,-1.5) [-10|10] \"m\" B\n SG_ Heading : 23|12@0- (0.0001,0) [0|0] \"rad\" B\n\n\
    BO_ 272 Column: 8 A\n SG_ Which M : 0|2@1+ (1,0) [0|3] \"\" B\n SG_ Torque m0 : 8|32@1- (1,0) [0|0] \"N.m\" B\n \
    SG_ Angle m1 : 8|16@1- (0.1,0) [-900|900] \"deg\" B\n\nBO_ 2147484192 Far: 4 B\n SG_ Speed : 7|16@0+ (0.01,0) [0|0] \"km/h\" A\n\n\
    SIG_VALTYPE_ 272 Torque : 1;\nCM_ SG_ 256 Offset \"left is positive\";\nBA_DEF_ BO_ \"E2EDataIds\" STRING ;\n\
    BA_DEF_DEF_ \"E2EDataIds\" \"\";\nBA_ \"E2EDataIds\" BO_ 256 \"01 02 03 04 05 06 07 08 09 0A 0B 0C 0D 0E 0F 10\";\n\
    VAL_ 272 Which 0 \"torque\" 1 \"angle\" ;\n";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The files of a folder, the shortest first.
fn files(folder: &str, extension: &str) -> Vec<Vec<u8>> {
    let entries = std::fs::read_dir(root().join(folder)).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> = paths
        .filter(|p| p.extension().is_some_and(|x| x == extension))
        .collect();
    paths.sort();
    let mut files: Vec<Vec<u8>> = paths.iter().map(|path| std::fs::read(path).unwrap()).collect();
    files.sort_by_key(Vec::len);
    assert!(!files.is_empty(), "{folder}");
    files
}

/// A drive of 12 s at 25 Hz, in the columns of a log.
fn drive() -> Recording {
    let time_s: Vec<f64> = (0..300).map(|k| f64::from(k) * 0.04).collect();
    let course = |name: &str, unit: &str, factor: f64| Series {
        name: name.into(),
        unit: unit.into(),
        source: "bench".into(),
        values: time_s
            .iter()
            .map(|t| (factor * (3.0 * t + factor).sin() * 1e3).round() / 1e3)
            .collect(),
    };
    let channels = vec![
        course("e_y_m", "m", 0.3),
        course("e_theta_rad", "rad", 0.02),
        course("wheel_angle_rad", "rad", 0.1),
        course("guidance_torque_nm", "N.m", 0.4),
        course("driver_torque_nm", "N.m", 0.9),
        course("speed_m_per_s", "m/s", 20.0),
    ];
    Recording::of(Group::new(time_s, channels))
}

/// What a writer leaves.
fn written(extension: &str, write: impl FnOnce(&Path)) -> Vec<u8> {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join(format!("seed.{extension}"));
    write(&path);
    std::fs::read(path).unwrap()
}

pub(crate) fn table(extension: &str) -> Vec<Vec<u8>> {
    vec![written(extension, |path| formats::write(path, drive()).unwrap())]
}

pub(crate) fn csv() -> Vec<Vec<u8>> {
    let mut seeds = table("csv");
    let with_units = "\u{feff}# bench 7\nt [ms];T_d (Nm);\"Speed [km/h]\";note\n0;0.5;50,1;a\n10;-;51;\"b;\"\"c\"\"\"\n20;nan;;\n";
    seeds.extend([with_units, &with_units.replace(';', "\t")].map(|text| text.as_bytes().to_vec()));
    let mut trace = Vec::new();
    let samples = (0..30).map(|k| Sample {
        time_s: f64::from(k) / 200.0,
        ..Sample::default()
    });
    let sample_rate_hz = 200.0;
    let samples = samples.collect();
    Trace {
        sample_rate_hz,
        samples,
    }
    .write_csv(&mut trace)
    .unwrap();
    seeds.push(trace);
    seeds
}

pub(crate) fn parquet() -> Vec<Vec<u8>> {
    [table("parquet"), files("tests/data/parquet", "parquet")].concat()
}

/// Frames of the small bus and of others.
pub(crate) fn frames(count: u32) -> Vec<BusFrame> {
    let frame = |k: u32| BusFrame {
        line: k as usize + 1,
        time_s: 1.7e9 + f64::from(k) * 0.01,
        id: [0x100, 0x110, 0x220, 0x7FF][k as usize % 4],
        extended: k % 4 == 2,
        bus: "can0".into(),
        data: (0..8).map(|i| (k * 37 + i * 11) as u8).collect(),
        ..BusFrame::default()
    };
    (0..count).map(frame).collect()
}

/// Some frames, and 11.5 s of a drive by hand, of which most frames are left out.
pub(crate) fn bus(extension: &str) -> Vec<Vec<u8>> {
    let driver = DriverParameters {
        remnant_sd_nm: 0.1,
        ..DriverParameters::default()
    };
    let mut simulation = Simulation::new(&Scenario::builder().driver(driver).build().unwrap());
    let mut drive = Vec::new();
    while let Some(outcome) = simulation.step(&Action::default()) {
        let step = outcome.observation.step;
        if step > 11_500 {
            break;
        }
        for frame in outcome.frames_in {
            let every = [(0x110, 20), (0x120, 20)]
                .into_iter()
                .find(|(id, _)| *id == frame.id());
            if frame.id() <= 0x120 && every.is_none_or(|(_, every)| step % every == 0) {
                drive.push(BusFrame {
                    line: 0,
                    time_s: 1.7e9 + f64::from(step) * 1e-3,
                    bus: "can0".into(),
                    id: frame.id().into(),
                    data: frame.data().to_vec(),
                    ..BusFrame::default()
                });
            }
        }
    }
    let write = |frames: &[BusFrame]| {
        written(extension, |path| {
            formats::write_frames(path, &BusLog::of_frames(frames.to_vec(), Notes::default())).unwrap();
        })
    };
    let mut seeds = vec![write(&frames(12)), write(&frames(60)), write(&drive)];
    if extension == "log" {
        let mut other = String::new();
        for frame in frames(20) {
            let bytes: Vec<String> = frame.data.iter().map(|byte| format!("{byte:02X}")).collect();
            writeln!(
                other,
                " ({:.6})  can0  {:03X}   [8]  {}",
                frame.time_s,
                frame.id,
                bytes.join(" ")
            )
            .unwrap();
        }
        seeds.insert(1, other.into_bytes());
    }
    seeds
}

fn object(kind: u32, head: &[u8], body: &[u8]) -> Vec<u8> {
    let size = 16 + (head.len() + body.len()) as u32;
    let mut object = b"LOBJ".to_vec();
    object.extend((16 + head.len() as u16).to_le_bytes());
    object.extend(1_u16.to_le_bytes());
    object.extend(size.to_le_bytes());
    object.extend(kind.to_le_bytes());
    object.extend(head);
    object.extend(body);
    object.resize(object.len() + size as usize % 4, 0);
    object
}

/// What stands in the containers of a BLF file.
pub(crate) fn blf_objects() -> Vec<Vec<u8>> {
    let message = |kind: u32| {
        move |frame: BusFrame| {
            let ns = ((frame.time_s - 1.7e9) * 1e9) as u64;
            let head = [&2_u32.to_le_bytes()[..], &[0; 4], &ns.to_le_bytes()].concat();
            let extended = u32::from(frame.extended) << 31;
            let body = [
                &[1, 0, 0, 8][..],
                &(frame.id | extended).to_le_bytes(),
                &frame.data,
            ]
            .concat();
            object(kind, &head, &body)
        }
    };
    let others = [object(65, &[0; 16], b"a text"), object(100, &[], &[])].concat();
    let stream =
        |kind: u32, count: u32| -> Vec<u8> { frames(count).into_iter().flat_map(message(kind)).collect() };
    vec![
        stream(1, 6),
        [stream(86, 4), others, stream(1, 3)].concat(),
        stream(1, 60),
    ]
}

/// A BLF file of objects: in a container, deflated or not, or as they are.
pub(crate) fn blf_file(objects: Vec<u8>) -> Vec<u8> {
    let mut file = written("blf", |path| {
        formats::write_frames(path, &BusLog::of_frames(frames(1), Notes::default())).unwrap();
    });
    file.truncate(144);
    let container = |method: u8, inside: &[u8]| {
        let head = [
            &[method, 0, 0, 0, 0, 0, 0, 0][..],
            &(objects.len() as u32).to_le_bytes(),
            &[0; 4],
        ]
        .concat();
        object(10, &head, inside)
    };
    match objects.len() % 3 {
        0 => file.extend(&objects),
        1 => file.extend(container(0, &objects)),
        _ => file.extend(container(
            2,
            &miniz_oxide::deflate::compress_to_vec_zlib(&objects, 1),
        )),
    }
    file
}

/// A MAT file with each of its variables compressed.
pub(crate) fn compressed_mat(plain: Vec<u8>) -> Vec<u8> {
    let mut file = plain[..plain.len().min(128)].to_vec();
    let mut rest = &plain[file.len()..];
    while !rest.is_empty() {
        let size = rest
            .get(4..8)
            .map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let end = (size as usize)
            .next_multiple_of(8)
            .saturating_add(8)
            .min(rest.len());
        let packed = miniz_oxide::deflate::compress_to_vec_zlib(&rest[..end], 1);
        file.extend(15_u32.to_le_bytes());
        file.extend((packed.len() as u32).to_le_bytes());
        file.extend(packed);
        rest = &rest[end..];
    }
    file
}

pub(crate) fn dbc() -> Vec<Vec<u8>> {
    [SMALL_DBC; 15]
        .into_iter()
        .chain([HAPTIC_DBC])
        .map(|text| text.as_bytes().to_vec())
        .collect()
}

pub(crate) fn toml() -> Vec<Vec<u8>> {
    let inline = "speed_m_per_s = 14\n[course]\nname = \"mine\"\nlane_width_m = 3\n[[course.segment]]\nlength_m = 300\n\
                  curvature_start_per_m = 0\ncurvature_end_per_m = 0.01\n";
    let speed = "[speed]\ntime_s = [0, 10]\nspeed_m_per_s = [14, 25]\n[failure]\ntime_s = 20\n";
    let sweep = "samples = 4\ndesign = \"latin-hypercube\"\n[vary]\nspeed = [40, 50]\n\
                 \"driver.t_p_s\" = { uniform = [0.1, 0.3] }\nseed = { from = 1, to = 5, count = 3 }\n";
    let mut seeds: Vec<Vec<u8>> = [inline, speed, sweep]
        .map(|text| text.as_bytes().to_vec())
        .to_vec();
    seeds.extend(files("tests/data", "toml"));
    seeds.extend(files("examples", "toml"));
    seeds
}

pub(crate) fn opendrive() -> Vec<Vec<u8>> {
    files("tests/data/xodr", "xodr")
}
