//! The channels of a trace: in a file, and in the document that describes it.

use haptic_log::recording::{Group, Recording, Series};
use haptic_log::table::TableError;
use haptic_log::trace::{CHANNELS, Sample, Trace};

fn written(trace: &Trace) -> String {
    let mut csv = Vec::new();
    trace.write_csv(&mut csv).unwrap();
    String::from_utf8(csv).unwrap()
}

fn trace(samples: Vec<Sample>) -> Trace {
    Trace {
        sample_rate_hz: 120.0,
        samples,
    }
}

#[test]
fn a_trace_is_written_as_the_heading_says() {
    let sample = Sample {
        time_s: 1.0 / 120.0,
        s_m: 12.5,
        lateral_error_m: -0.25,
        e_y_m: 0.125,
        wheel_angle_rad: f64::NAN,
        driver_torque_nm: -1e-9,
        guidance_torque_nm: -0.47,
        guidance_limited: true,
        speed_m_per_s: 16.6666667,
        unguided_cause: -2.0,
        ..Sample::default()
    };
    assert_eq!(
        written(&trace(vec![sample])),
        "time_s,e_y_m,e_theta_rad,wheel_angle_rad,guidance_torque_nm,driver_torque_nm,lateral_error_m,s_m,\
         heading_error_rad,curvature_1pm,guidance_e_y_m,guidance_e_theta_rad,wheel_rate_rad_per_s,\
         yaw_rate_rad_per_s,sideslip_rad,guidance_limited,speed_m_per_s,unguided_cause\n\
         0.008333,0.125000,0.0000000,,-0.47000,0.00000,-0.250000,12.5000,\
         0.0000000,0.00000000,0.000000,0.0000000,0.000000,0.0000000,0.0000000,1,16.666667,-2\n"
    );
}

/// The n-th channel of the k-th sample is n + k/16, which every channel's digits hold but the flag's and the code's.
#[test]
fn what_is_written_is_read_back_channel_by_channel() {
    let header = CHANNELS.map(|channel| channel.name).join(",");
    let row = |k: usize| {
        let value = |n: usize| match CHANNELS[n].decimals {
            0 => (k % 2).to_string(),
            decimals => format!("{:.decimals$}", n as f64 + k as f64 / 16.0),
        };
        (0..CHANNELS.len()).map(value).collect::<Vec<_>>().join(",")
    };
    let text = format!("{header}\n{}\n{}\n{}\n", row(0), row(1), row(2));
    let read = Trace::read_csv(text.as_bytes()).unwrap();
    assert_eq!(read.sample_rate_hz, 16.0);
    assert_eq!(read.samples[1].time_s, 0.0625);
    assert!(read.samples[1].guidance_limited && !read.samples[2].guidance_limited);
    assert_eq!(written(&read), text);
}

#[test]
fn what_is_no_trace_is_refused_with_line_and_column() {
    let text = written(&trace(vec![Sample::default(); 2]));
    let refusal = |text: &str| Trace::read_csv(text.as_bytes()).unwrap_err();
    assert_eq!(
        refusal(&text.replace("s_m,", "s_km,")),
        TableError::MissingColumn("s_m".into())
    );
    assert_eq!(
        refusal(&text.replacen("0.000000,0.000000,", "0.000000,left,", 1)).to_string(),
        "line 2: e_y_m is \"left\", which is not a number"
    );
}

/// What earlier versions have written.
#[test]
fn a_trace_without_speed_and_cause_is_read() {
    let text = written(&trace(vec![Sample::default(); 2]));
    let without: String = text
        .lines()
        .map(|line| line.rsplitn(3, ',').last().unwrap().to_owned() + "\n")
        .collect();
    assert!(
        !without.contains("speed") && !without.contains("unguided"),
        "{without}"
    );
    let read = Trace::read_csv(without.as_bytes()).unwrap();
    let is_unknown = |s: &Sample| s.speed_m_per_s.is_nan() && s.unguided_cause.is_nan();
    assert!(read.samples.len() == 2 && read.samples.iter().all(is_unknown));
}

/// A unit that is not the end of the channel's name would be a lie in every file.
#[test]
fn a_name_ends_with_its_unit() {
    for channel in CHANNELS {
        let suffix = match channel.unit {
            "s" => "_s",
            "m" => "_m",
            "1/m" => "_1pm",
            "m/s" => "_m_per_s",
            "rad" => "_rad",
            "rad/s" => "_rad_per_s",
            "N.m" => "_nm",
            "1" => "",
            other => panic!("{}: no suffix is agreed for the unit {other}", channel.name),
        };
        assert!(
            channel.name.ends_with(suffix),
            "{} is in {}",
            channel.name,
            channel.unit
        );
    }
}

/// The channels as a Markdown table.
fn table_of_channels() -> String {
    let mut text = String::from("| column | unit | digits | of | meaning |\n|---|---|---|---|---|\n");
    for channel in CHANNELS {
        let (name, unit, digits, source) = (channel.name, channel.unit, channel.decimals, channel.source);
        let meaning = channel.meaning.trim();
        text.push_str(&format!(
            "| `{name}` | {unit} | {digits} | {source} | {meaning} |\n"
        ));
    }
    text
}

#[test]
fn the_document_has_the_table_of_channels() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/reference/formats.md");
    let text = std::fs::read_to_string(path).expect("docs/reference/formats.md");
    let table = table_of_channels();
    assert!(
        text.contains(&table),
        "docs/reference/formats.md lacks this table:\n{table}"
    );
}

/// The instants of two groups are one list, in which a negative zero is zero.
#[test]
fn groups_that_begin_at_zero_and_at_its_negative_share_the_instant() {
    let group = |name: &str, time_s: Vec<f64>, values: Vec<f64>| Group {
        name: name.into(),
        time_s,
        channels: vec![Series {
            name: format!("{name}_nm"),
            unit: "N.m".into(),
            source: String::new(),
            values,
        }],
        ..Group::default()
    };
    let groups = vec![
        group("a", vec![-0.0, 0.1], vec![1.0, 2.0]),
        group("b", vec![0.0, 0.1, 0.2], vec![3.0, 4.0, 5.0]),
    ];
    let one = Recording::from(groups).into_one_group().unwrap();
    assert_eq!(one.time_s, [0.0, 0.1, 0.2]);
    assert_eq!(one.channels[0].values[..2], [1.0, 2.0]);
    assert!(one.channels[0].values[2].is_nan());
    assert_eq!(one.channels[1].values, [3.0, 4.0, 5.0]);
}
