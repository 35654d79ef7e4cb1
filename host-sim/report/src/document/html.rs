//! A report as HTML: structure and style sheet.
//!
//! Text goes through the template's escaping; the only raw insertions are the style sheets, the script, the data of
//! the figures, in which nothing can end the script, and drawings made by `plot`, which escapes its own text. The
//! content security policy forbids the browser to load anything, and to run anything but that script. Without the
//! script, and on paper, the drawings show.

use haptic_log::Event;

use super::{Block, Cell, Drawings, Provenance, Report, Section, Table, chart, signed};
use crate::plot::{Figure, PlotError};
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// Figures keep white paper in the dark: their colours are chosen for it.
const STYLE: &str = include_str!("report.css");

pub(super) fn document(report: &Report, drawings: &Drawings) -> Result<String, PlotError> {
    let shown = |section: &&Section| section.blocks.iter().any(Block::is_on_page);
    let parts: Vec<&Section> = report.sections.iter().filter(shown).collect();
    let sections = parts
        .iter()
        .enumerate()
        .map(|(i, s)| section(i, s, drawings))
        .collect::<Result<Vec<_>, _>>()?;
    let policy = format!(
        "default-src 'none'; style-src 'unsafe-inline'; script-src '{}'",
        chart::script_hash()
    );
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(policy);
                title { (report.title) }
                style { (PreEscaped(chart::STYLE)) (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { (report.title) }
                    @if !report.summary.is_empty() { p { (report.summary) } }
                    @for note in &report.notes { p { "Note: " (note) "." } }
                    nav {
                        @for (i, section) in parts.iter().enumerate() {
                            a href={ "#section-" (i + 1) } { (section.heading) }
                        }
                    }
                }
                main { @for section in &sections { (section) } }
                (footer(&report.provenance))
                script { (PreEscaped(chart::SCRIPT)) }
            }
        }
    };
    Ok(page.into_string())
}

fn section(index: usize, section: &Section, drawings: &Drawings) -> Result<Markup, PlotError> {
    let blocks = section
        .blocks
        .iter()
        .enumerate()
        .map(|(i, b)| block(&format!("{index}-{i}"), b, drawings))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(html! {
        section id={ "section-" (index + 1) } {
            h2 { (section.heading) }
            @for block in &blocks { (block) }
        }
    })
}

/// `id` tells the block from the others of the page.
fn block(id: &str, block: &Block, drawings: &Drawings) -> Result<Markup, PlotError> {
    Ok(match block {
        Block::Text(text) => html! { p { (text) } },
        Block::Table(t) => html! { @if !t.rows.is_empty() { (table(t)) } },
        Block::Figure {
            name,
            figure,
            caption,
        } => match drawings.get(name.as_str()) {
            Some(drawn) => self::figure(id, figure, caption, drawn),
            None => self::figure(id, figure, caption, &drawn(figure)?),
        },
        Block::Events(list) => events(list),
        Block::OnPage(block) => self::block(id, block, drawings)?,
        Block::OnTerminal(_) => html! {},
    })
}

/// The SVGs of a figure, one for each page of paper that it takes.
pub(super) fn drawn(figure: &Figure) -> Result<Vec<String>, PlotError> {
    figure.pages().iter().map(Figure::to_svg).collect()
}

fn figure(id: &str, figure: &Figure, caption: &str, drawn: &[String]) -> Markup {
    // Names of clip paths have to differ from those of the page's other drawings.
    let named = |number| format!("clip-{id}-{number}-");
    let drawings = drawn.iter().enumerate();
    let drawings = drawings.map(|(number, svg)| svg.replace("kuva-clip-", &named(number)));
    let data = chart::data(figure);
    html! {
        figure {
            @for svg in drawings { (PreEscaped(svg)) }
            figcaption {
                (caption)
                @if data.is_some() { span.hint { " Drag to zoom, double-click to see all again." } }
            }
            @if let Some(data) = data { script type="application/json" { (PreEscaped(data)) } }
        }
    }
}

fn footer(provenance: &Provenance) -> Markup {
    html! {
        footer {
            p { (provenance.program) " " (provenance.version) ", commit " (provenance.commit) "." }
            @if let Some(scenario) = &provenance.scenario {
                details {
                    summary { "The scenario, to be run again" }
                    pre { (scenario) }
                }
            }
        }
    }
}

fn table(table: &Table) -> Markup {
    // A heading stands over its column: at the right over numbers.
    let is_number = |column: usize| {
        matches!(
            table.rows.first().and_then(|r| r.get(column)),
            Some(Cell::Number { .. } | Cell::Signed(_))
        )
    };
    html! {
        div.table {
            table {
                @if !table.caption.is_empty() { caption { (table.caption) } }
                thead { tr {
                    @for (i, column) in table.columns.iter().enumerate() {
                        th.number[is_number(i)] scope="col" { (column) }
                    }
                } }
                tbody {
                    @for row in &table.rows {
                        tr { @for c in row { (cell(c)) } }
                    }
                }
            }
        }
    }
}

fn cell(cell: &Cell) -> Markup {
    match cell {
        // Names of conditions stay on one line, sentences break.
        Cell::Text(text) => html! { td.short[text.chars().count() <= 20] { (text) } },
        Cell::Number { value, decimals } => html! { td.number { (number(*value, *decimals)) } },
        Cell::Signed(value) => html! { td.number { (signed(*value)) } },
    }
}

/// A number in plain ASCII, so that it can be copied into a spreadsheet; no negative zero.
pub(super) fn number(value: Option<f64>, decimals: usize) -> String {
    match value.filter(|v| v.is_finite()) {
        None => "\u{2013}".into(),
        Some(value) => haptic_log::table::fixed(value, decimals),
    }
}

fn events(events: &[Event]) -> Markup {
    html! {
        @if events.is_empty() { p { "No events." } }
        @else {
            ol.events {
                @for event in events {
                    li { span.time { (number(Some(event.time_s), 3)) " s" } " " (event.what) }
                }
            }
        }
    }
}
