//! What is shown of the bus's load: a table and a figure.

use serde::Serialize;

use super::place;
use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Mark, Series};
use haptic_batch::bus_load::{BIT_RATE, MAX_LOAD, MessageLoad};

/// The load of the bus, as JSON holds it.
#[derive(Debug, Clone, Serialize)]
pub struct Load {
    /// Bits per second.
    pub bit_rate: f64,
    /// Every message, most urgent first.
    pub messages: Vec<MessageLoad>,
    /// Load of all messages, from 0 to 1.
    pub load: f64,
    /// Load while nobody writes parameters, as in all that is not Standby.
    pub driving: f64,
    /// Most that this may be.
    pub max_load: f64,
}

impl Load {
    /// The load that these messages make.
    pub fn new(messages: Vec<MessageLoad>) -> Self {
        Self {
            bit_rate: BIT_RATE,
            load: messages.iter().map(|row| row.load).sum(),
            driving: messages
                .iter()
                .filter(|row| !row.in_standby)
                .map(|row| row.load)
                .sum(),
            messages,
            max_load: MAX_LOAD,
        }
    }

    /// The sentence that says what it may be.
    fn judgement(&self) -> String {
        format!(
            "While nobody writes parameters: {:.2} %, of at most {:.2} % of {:.0} kbit/s.",
            100.0 * self.driving,
            100.0 * self.max_load,
            self.bit_rate / 1000.0
        )
    }

    /// Message by message, and the sum.
    fn table(&self) -> Table {
        let share = |load: f64| Cell::number(100.0 * load, 2);
        let row = |row: &MessageLoad| {
            vec![
                Cell::Text(row.message.clone()),
                Cell::Text(format!("{:#05x}", row.id)),
                Cell::number(row.period_ms, 1),
                Cell::count(row.bits),
                share(row.load),
            ]
        };
        let sum = ["all", "", "", ""]
            .into_iter()
            .map(Cell::text)
            .chain([share(self.load)]);
        let columns = ["Message", "Identifier", "Period (ms)", "Bits", "Load (%)"];
        Table::new("", columns, self.messages.iter().map(row).chain([sum.collect()]))
    }

    fn figure(&self) -> Figure {
        let points = self.messages.iter().enumerate();
        let points = points.map(|(i, row)| (place(i), 100.0 * row.load)).collect();
        let most = self.messages.iter().map(|m| m.load).fold(0.0, f64::max);
        let y = Axis::new("Worst-case share of the bus", "%").within(0.0, 108.0 * most);
        let panel = y.panel([Series::with_mark("", 1, Mark::Stems, points)]);
        Figure::of_rows(self.messages.iter().map(|row| row.message.as_str()), [panel])
    }

    /// The document of the load.
    pub fn report(&self) -> Report {
        let caption = "Every message at its shortest period, with every stuff bit that can occur.";
        let blocks = vec![
            Block::figure("bus", self.figure(), caption),
            Block::Table(self.table()),
        ];
        let summary = format!(
            "All messages together: {:.2} %. {}",
            100.0 * self.load,
            self.judgement()
        );
        let sections = vec![Section::new("Message by message", blocks)];
        Report::new("How full the bus is at worst", summary, sections)
    }
}
