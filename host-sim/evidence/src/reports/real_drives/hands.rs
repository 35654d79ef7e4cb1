//! Hands and override on recordings of real people.

use haptic_evidence::real_drives::{End, Ending, Fed, Feed, Hands};
use haptic_report::document::{Block, Cell, Table};
use haptic_report::plot::{Axis, Figure, Series};

/// The section's blocks.
pub(super) fn section(hands: &Hands) -> Vec<Block> {
    let [by_hand, shared] = hands.seconds;
    let [felt_by_hand, felt_shared] = hands.own().felt.map(|share| 100.0 * share);
    let [low, high] = hands.area_95;
    let [taps, short, long] = hands.pushes;
    let text = format!(
        "{} recordings have a torque in N.m and say who steers: {by_hand} s by hand and {shared} s shared, above 8 m/s. Where the hands \
         are none says. By hand one is on the wheel; in shared driving it is not known, and the torsion bar feels the motor. By the ECU's \
         threshold a hand is felt in {felt_by_hand:.1} % of the seconds by hand and in {felt_shared:.1} % of the shared ones; the longest \
         shared time without is {:.1} s, and the warning comes after 15 s. The area under the curve is {:.2} ({low:.2} to {high:.2}): how well \
         the torque tells the two ways of driving apart, not hands from none. Nothing says which pushes are a driver's override: of those \
         above 0.8 N.m against the guidance {taps} last up to 0.2 s, {short} up to 1 s and {long} longer.",
        hands.recordings, hands.longest_s, hands.area
    );
    let caption = "Seconds in which a hand is felt, by the threshold: the ECU's own code with 1/8 to 64 times its thresholds of 0.08 N.m (change) \
                   and 0.35 N.m (size). Top right the lowest one.";
    vec![
        Block::Text(text),
        Block::figure("hands", curve(hands), caption),
        Block::Table(hours(hands)),
        Block::Table(endings(hands)),
        Block::Table(ends(hands)),
    ]
}

fn curve(hands: &Hands) -> Figure {
    let point = |felt: [f64; 2]| (100.0 * felt[1], 100.0 * felt[0]);
    let all = hands.curve.iter().map(|threshold| point(threshold.felt));
    let all = std::iter::once((100.0, 100.0)).chain(all).chain([(0.0, 0.0)]);
    let panel = Axis::new("felt by hand", "%").within(0.0, 102.0).panel([
        Series::line("no difference", 0, vec![(0.0, 0.0), (100.0, 100.0)]),
        Series::line("by threshold", 1, all.collect()),
        Series::dots("the ECU's threshold", 2, vec![point(hands.own().felt)]),
    ]);
    Axis::new("felt in shared driving", "%")
        .within(0.0, 100.0)
        .figure([panel])
}

fn between(feed: Feed) -> Cell {
    Cell::text(match feed {
        Feed::Line => "on a line",
        Feed::Held => "held",
        Feed::Nothing => "nothing sent",
    })
}

fn hours(hands: &Hands) -> Table {
    let row = |fed: &Fed| {
        [
            ("Between rows", between(fed.feed)),
            ("By hand, h", Cell::number(fed.hours[0], 4)),
            ("guided, h", Cell::number(fed.guided_h[0], 4)),
            ("Shared, h", Cell::number(fed.hours[1], 4)),
            ("guided, h", Cell::number(fed.guided_h[1], 4)),
            ("Overridden, s", Cell::number(3600.0 * fed.overridden_h, 2)),
        ]
    };
    Table::of_rows(
        "The recordings as frames of the ECU's bus at its own rates; between two rows of 0.1 s the values are on a line or held, or nothing is \
         sent. Guidance is asked for throughout, and again 5 s after each end; the torque is the recorded one.",
        hands.feeds.iter().map(row),
    )
}

fn endings(hands: &Hands) -> Table {
    let row = |(fed, end): (&Fed, &Ending)| {
        let rates = ["By hand", "Shared"]
            .into_iter()
            .zip(&end.rates)
            .flat_map(|(driving, rate)| {
                let [low, high] = Cell::ends(rate.interval, 1);
                [
                    (driving, Cell::count(rate.count)),
                    ("1/h", Cell::number(rate.per_hour, 1)),
                    ("from", low),
                    ("to", high),
                ]
            });
        let head = [
            ("Between rows", between(fed.feed)),
            ("Ended by", Cell::text(&end.faults)),
        ];
        head.into_iter().chain(rates).collect::<Vec<_>>()
    };
    let feeds = hands.feeds.iter();
    let all = feeds.flat_map(|fed| fed.endings.iter().map(move |end| (fed, end)));
    Table::of_rows(
        "What would have ended guidance, in an hour with it, with the 95 % interval of a Poisson rate. The recordings have no lane at a camera's \
         rate, no second speed and no report of the motor. The lane is the way that the vehicle goes, the speed is sent twice, the motor does \
         what the ECU says: what checks these cannot act. Slower than 5 m/s is no fault and not counted.",
        all.map(row),
    )
}

fn ends(hands: &Hands) -> Table {
    let row = |end: &End| {
        let driving = if end.shared { "shared" } else { "by hand" };
        [
            ("Recording", Cell::text(&end.file)),
            ("Driving", Cell::text(driving)),
            ("At, s", Cell::number(end.time_s, 1)),
            ("Ended by", Cell::text(&end.faults)),
            ("T_d, N.m", Cell::number(end.driver_nm, 2)),
            ("T_h, N.m", Cell::number(end.guidance_nm, 2)),
            ("Wheel, deg", Cell::number(end.wheel_deg, 1)),
        ]
    };
    let on_a_line = hands.feeds.iter().filter(|fed| fed.feed == Feed::Line);
    Table::of_rows(
        "Each end with values on a line: the mean torques of the second before it, and how far the wheel turned in it.",
        on_a_line.flat_map(|fed| &fed.ends).map(row),
    )
}
