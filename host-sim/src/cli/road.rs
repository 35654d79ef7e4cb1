//! The options that choose a road: a course file, and road and lane of an OpenDRIVE file.

use std::path::{Path, PathBuf};

use clap::Args;
use haptic_sim::input::InputError;
use haptic_sim::models::road::{Course, LaneChoice};

#[derive(Debug, Args)]
pub(super) struct CourseArguments {
    /// Course file (TOML or OpenDRIVE .xodr; see docs/files.md) or paper-course; default: what the command says
    #[arg(long, value_name = "FILE")]
    course: Option<PathBuf>,
    #[command(flatten)]
    lane: LaneArguments,
}

#[derive(Debug, Args)]
pub(super) struct LaneArguments {
    /// Road of an OpenDRIVE file to begin on, by its id; default: the first of the only chain of linked roads
    #[arg(long, value_name = "ID")]
    road: Option<String>,
    /// Lane of that road to begin in, by its id (right lanes are negative); default: the rightmost driving lane in
    /// the direction of travel
    #[arg(long, value_name = "N")]
    lane: Option<i32>,
    /// Where a junction leads on to several roads, the one to take, by the id of the road through the junction or of the one
    /// behind it; may be repeated. Without it the way ends at such a junction
    #[arg(long, value_name = "ID")]
    turn: Vec<String>,
}

impl LaneArguments {
    pub(super) fn choice(&self) -> LaneChoice {
        LaneChoice {
            road: self.road.clone(),
            lane: self.lane,
            turns: self.turn.clone(),
        }
    }
}

impl CourseArguments {
    /// The course chosen, if one is.
    pub(super) fn open(&self) -> Result<Option<Course>, InputError> {
        let choice = self.lane.choice();
        match &self.course {
            Some(path) => open(path, &choice).map(Some),
            None if choice == LaneChoice::default() => Ok(None),
            None => {
                let options = "--road, --lane and --turn";
                Err(InputError::new(options, "they need --course FILE.xodr"))
            }
        }
    }
}

/// Opens a course and says on stderr what was decided.
pub(super) fn open(path: &Path, choice: &LaneChoice) -> Result<Course, InputError> {
    let course = haptic_batch::files::open_course(path, choice)?;
    super::print_notes(course.notes());
    Ok(course)
}
