//! The transition table of the code against the table and the drawing in docs/explanation/behaviour.md, written
//! by hand.

use haptic_core::safety::modes::{Event, Events, Mode};
use std::collections::BTreeSet;

const BEHAVIOUR: &str = include_str!("../../docs/explanation/behaviour.md");

fn mode(name: &str) -> Mode {
    let named = |mode: &Mode| format!("{mode:?}") == name;
    Mode::ALL
        .into_iter()
        .find(named)
        .unwrap_or_else(|| panic!("docs/explanation/behaviour.md: no mode {name}"))
}

/// The table as rows of cells, its head first.
fn table() -> Vec<Vec<&'static str>> {
    BEHAVIOUR
        .lines()
        .skip_while(|line| !line.starts_with("| mode | BootPassed"))
        .take_while(|line| line.starts_with('|'))
        .filter(|line| !line.starts_with("|-"))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect()
}

#[test]
fn every_transition_is_the_one_in_the_table() {
    let table = table();
    let (head, rows) = table.split_first().unwrap();
    let events: Vec<String> = Event::ALL.iter().map(|event| format!("{event:?}")).collect();
    assert_eq!(head[1..], events);
    assert_eq!(rows.len(), Mode::ALL.len());
    for row in rows {
        let from = mode(row[0]);
        for (event, cell) in Event::ALL.into_iter().zip(&row[1..]) {
            let expected = if *cell == "." { from } else { mode(cell) };
            assert_eq!(from.after(event), expected, "{from:?} after {event:?}");
        }
    }
}

#[test]
fn the_drawing_shows_the_table() {
    let mut drawn = BTreeSet::new();
    for line in BEHAVIOUR
        .lines()
        .filter(|line| line.contains("-->") && line.contains(": "))
    {
        let (arrow, event) = line.trim().split_once(": ").unwrap();
        let (from, to) = arrow.split_once(" --> ").unwrap();
        drawn.insert([from, event, to].map(str::to_string));
    }
    let mut tabled = BTreeSet::new();
    for row in &table()[1..] {
        for (event, to) in table()[0][1..]
            .iter()
            .zip(&row[1..])
            .filter(|(_, to)| **to != ".")
        {
            tabled.insert([row[0], event, to].map(str::to_string));
        }
    }
    assert_eq!(drawn, tabled);
    assert!(BEHAVIOUR.contains("[*] --> Boot"));
}

#[test]
fn only_a_request_in_standby_leads_into_active() {
    for from in Mode::ALL {
        for event in Event::ALL {
            let enters = from != Mode::Active && from.after(event) == Mode::Active;
            assert_eq!(
                enters,
                from == Mode::Standby && event == Event::Engage,
                "{from:?} {event:?}"
            );
        }
    }
}

#[test]
fn torque_in_three_modes_only_and_codes_as_on_the_bus() {
    for mode in Mode::ALL {
        let expected = [Mode::Active, Mode::Fade, Mode::Handover].contains(&mode);
        assert_eq!(mode.may_have_torque(), expected, "{mode:?}");
    }
    let codes: Vec<_> = (0..8).map(Mode::from_code).collect();
    assert_eq!(codes[..7], Mode::ALL.map(Some));
    assert_eq!(codes[7], None);
}

#[test]
fn of_all_that_is_raised_the_most_urgent_change_decides() {
    for from in Mode::ALL {
        for set in 1_u32..1 << Event::ALL.len() {
            let is_raised =
                |event: Event| set >> Event::ALL.iter().position(|e| *e == event).unwrap() & 1 == 1;
            let mut raised = Event::ALL.into_iter().filter(|event| is_raised(*event));
            let first = raised.next().unwrap();
            let mut events = Events::only(first);
            for event in Event::ALL.into_iter().filter(|event| *event != first) {
                events.insert_if(is_raised(event), event);
            }
            let urgent = raised
                .rev()
                .chain([first])
                .find(|event| from.after(*event) != from);
            let expected = urgent.map_or(from, |event| from.after(event));
            assert_eq!(from.after_all(events), expected, "{from:?} {set:07b}");
        }
    }
}
