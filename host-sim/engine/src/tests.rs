use std::ops::ControlFlow;
use std::sync::Mutex;

use haptic_sim::scenario::{Condition, Scenario, Sensors};
use haptic_sim::simulation::{Run, simulate};

use super::*;

/// The first curve of the paper's course at half the length, with guidance that is rejected in every third run: its sensors are exact.
struct Curves {
    count: u64,
    refused: Option<u64>,
}

fn scenario(number: u64) -> Result<Scenario, StudyError> {
    let course = crate::paper::stretched_curve(0.5)?;
    let sensors = if number.is_multiple_of(3) {
        Sensors::Exact
    } else {
        Sensors::Paper
    };
    let builder = Scenario::builder()
        .course(course)
        .condition(Condition::ALL[number as usize % 4]);
    Ok(builder.sensors(sensors).seed(number).build()?)
}

impl Study for Curves {
    type Case = u64;
    type Row = (u64, Run);
    type Results = Vec<(u64, Run)>;

    fn plan(&self) -> Result<Plan<u64>, StudyError> {
        Ok(Plan::side_by_side((0..self.count).collect(), 1))
    }

    fn drive(&self, part: &Part<'_, u64, (u64, Run)>) -> Result<Vec<(u64, Run)>, StudyError> {
        part.side_by_side(
            |number| scenario(*number),
            |number, _, run| match self.refused {
                Some(refused) if refused == *number => refuse("5"),
                _ => Ok((*number, run.clone())),
            },
        )
    }

    fn summarise(&self, _: Vec<u64>, rows: Vec<(u64, Run)>) -> Result<Self::Results, StudyError> {
        Ok(rows)
    }
}

/// Runs that are rejected and runs that are not: each once, in its place.
#[test]
fn every_run_is_driven_once_whoever_drives_it() {
    let study = |refused| Curves { count: 21, refused };
    let runs = study(None).run(&Watch::nobody()).unwrap();
    assert_eq!(runs.len(), 21);
    for (place, (number, run)) in runs.iter().enumerate() {
        assert_eq!(place as u64, *number);
        assert_eq!(*run, simulate(&scenario(*number).unwrap()));
    }
    assert_eq!(study(Some(5)).run(&Watch::nobody()), refuse("5"));
}

/// Squares of numbers, of which one may be given wrong.
struct Squares {
    one_short: bool,
}

impl Study for Squares {
    type Case = u64;
    type Row = u64;
    type Results = Vec<u64>;

    fn plan(&self) -> Result<Plan<u64>, StudyError> {
        Ok(Plan::one_by_one((0..40).collect()))
    }

    fn drive(&self, part: &Part<'_, u64, u64>) -> Result<Vec<u64>, StudyError> {
        let mut rows = part.one_by_one(|number| Ok(number * number))?;
        if self.one_short {
            rows.pop();
        }
        Ok(rows)
    }

    fn summarise(&self, _: Vec<u64>, rows: Vec<u64>) -> Result<Vec<u64>, StudyError> {
        Ok(rows)
    }

    fn drives(&self, _: &u64) -> u64 {
        2
    }
}

const SQUARES: Squares = Squares { one_short: false };

fn squares(numbers: impl Iterator<Item = u64>) -> Vec<u64> {
    numbers.map(|number| number * number).collect()
}

#[test]
fn what_is_kept_is_not_driven_again_and_progress_counts_it() {
    let told = Mutex::new(Vec::new());
    let hear = |progress| {
        told.lock().unwrap().push(progress);
        ControlFlow::Continue(())
    };
    let kept = Mutex::new(Vec::new());
    let store = Resumed {
        rows: &squares(0..10),
        is_of: |number: &u64, row: &u64| number * number == *row,
        keep: |row: &u64| {
            kept.lock().unwrap().push(*row);
            Ok(())
        },
    };
    assert_eq!(run(&SQUARES, &store, &Watch::new(&hear)), Ok(squares(0..40)));
    let mut kept = kept.into_inner().unwrap();
    kept.sort_unstable();
    assert_eq!(kept, squares(10..40));
    let told = told.into_inner().unwrap();
    let progress = |done| Progress {
        done,
        before: 20,
        all: 80,
    };
    assert_eq!(told, (10..=40).map(|case| progress(2 * case)).collect::<Vec<_>>());
}

#[test]
fn a_study_ends_when_it_is_told_to_and_when_enough_is_known() {
    let hear = |progress: Progress| {
        if progress.done < 20 {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    };
    assert_eq!(SQUARES.run(&Watch::new(&hear)), Err(StudyError::Interrupted));
    struct Enough;
    impl Store<u64, u64> for Enough {
        fn kept(&self, _: &u64) -> Result<Option<u64>, StudyError> {
            Ok(None)
        }
        fn keep(&self, number: &u64, _: &u64) -> Result<ControlFlow<()>, StudyError> {
            Ok(if *number == 7 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            })
        }
    }
    let alone = || run(&SQUARES, &Enough, &Watch::nobody());
    // One thread drives in order, so that nothing behind the eighth case is begun.
    assert_eq!(on_threads(Some(1), alone).unwrap(), Ok(squares(0..8)));
}

#[test]
fn a_part_that_loses_a_row_is_refused() {
    let study = Squares { one_short: true };
    let error = study.run(&Watch::nobody()).unwrap_err();
    assert_eq!(error.to_string(), "0 of 1 runs came back");
}
