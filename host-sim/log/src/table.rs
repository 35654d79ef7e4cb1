//! Tables of text fields under a heading row: CSV as people and programs write it.
//!
//! Written: RFC 4180 with a comma, a point as decimal sign and LF. Read: the same, with semicolons or tabs where the heading
//! has no comma, or what a line `sep=;` before it says; with CR LF or CR, a byte order mark, blanks around fields; empty lines
//! and lines that begin with `#` are passed over. A row is on the line on which it ends. Not here: what the columns mean.

use std::borrow::Cow;
use std::io::{self, BufRead, BufReader, Read, Write};

/// Why a table was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// It cannot be read at all.
    #[error("{0}")]
    Unreadable(String),
    /// A row cannot be read.
    #[error("line {line}: {what}")]
    Row {
        /// Its line, the first of the file being 1.
        line: u64,
        /// Why.
        what: String,
    },
    /// A row has another number of fields than the heading.
    #[error("line {line}: {found} fields where the header has {expected}")]
    Fields {
        /// Its line.
        line: u64,
        /// Its fields.
        found: usize,
        /// The fields of the heading.
        expected: usize,
    },
    /// A column that is needed is not there.
    #[error("there is no column {0}")]
    MissingColumn(String),
    /// A field that has to be a number is none.
    #[error("line {line}: {column} is {text:?}, which is not a number{}", hint(text))]
    NotANumber {
        /// Its line.
        line: u64,
        /// The name of its column.
        column: String,
        /// What it holds.
        text: String,
    },
}

/// What a text needs to be a number, where that is clear.
fn hint(text: &str) -> &'static str {
    match (text.parse(), text.replacen(',', ".", 1).parse::<f64>()) {
        (Ok(value), _) if is_beyond(text, value) => ": the largest is 1.8e308",
        (Err(_), Ok(_)) => ": the decimal sign is a point",
        _ => "",
    }
}

/// A row of a table.
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    /// The line of the file that it stands on, from 1.
    pub line: u64,
    fields: &'a csv::ByteRecord,
}

impl<'a> Row<'a> {
    /// The field of a column of the heading.
    #[must_use]
    pub fn field(self, column: usize) -> Cow<'a, str> {
        String::from_utf8_lossy(self.fields[column].trim_ascii())
    }
}

/// A text whose lines end in LF, the last one too, whatever they ended in.
struct Lf<R> {
    source: R,
    last: u8,
    after_cr: bool,
    /// Whether the last line did not end.
    is_open: bool,
}

impl<R: Read> Read for Lf<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        loop {
            let read = self.source.read(out)?;
            if read == 0 {
                let is_open = self.last != b'\n' && !out.is_empty();
                if is_open {
                    (self.last, out[0]) = (b'\n', b'\n');
                    self.is_open = true;
                }
                return Ok(usize::from(is_open));
            }
            let mut kept = read;
            if self.after_cr || out[..read].contains(&b'\r') {
                kept = 0;
                for place in 0..read {
                    let byte = out[place];
                    if !(self.after_cr && byte == b'\n') {
                        out[kept] = if byte == b'\r' { b'\n' } else { byte };
                        kept += 1;
                    }
                    self.after_cr = byte == b'\r';
                }
            }
            if kept > 0 {
                self.last = out[kept - 1];
                return Ok(kept);
            }
        }
    }
}

/// A table that is being read.
pub struct TableReader<R> {
    header: Vec<String>,
    header_line: u64,
    reader: csv::Reader<BufReader<Lf<R>>>,
    fields: csv::ByteRecord,
    cut: Option<u64>,
}

impl<R: Read> TableReader<R> {
    /// Reads the source's heading.
    ///
    /// # Errors
    /// What cannot be read.
    pub fn new(source: R) -> Result<Self, TableError> {
        let unreadable = |e: &dyn std::fmt::Display| TableError::Unreadable(e.to_string());
        let (last, after_cr, is_open) = (b'\n', false, false);
        let mut source = BufReader::new(Lf {
            source,
            last,
            after_cr,
            is_open,
        });
        let (mut header_line, mut separator) = (1, None);
        let heading = loop {
            let mut line = Vec::new();
            let read = source.read_until(b'\n', &mut line);
            if read.map_err(|e| unreadable(&e))? == 0 {
                break line;
            }
            if header_line == 1 && (line.starts_with(&[0xFF, 0xFE]) || line.starts_with(&[0xFE, 0xFF])) {
                return Err(unreadable(&"this is UTF-16: save it as UTF-8"));
            }
            let text = line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&line);
            let text = text.strip_suffix(b"\n").unwrap_or(text);
            let quoted = text.strip_prefix(b"\"").and_then(|rest| rest.strip_suffix(b"\""));
            match quoted.unwrap_or(text) {
                // As Excel writes it.
                &[s, e, p, b'=', said] if [s, e, p].eq_ignore_ascii_case(b"sep") => separator = Some(said),
                _ if text.starts_with(b"#") || text.trim_ascii().is_empty() => {}
                _ => break text.to_vec(),
            }
            header_line += 1;
        };
        let is_there = |c: &u8| !heading.contains(&b',') && heading.contains(c);
        let usual = [b';', b'\t'].into_iter().find(is_there).unwrap_or(b',');
        let mut table = csv::ReaderBuilder::new();
        table
            .delimiter(separator.unwrap_or(usual))
            .comment(Some(b'#'))
            .has_headers(false)
            .flexible(true);
        let mut names = csv::ByteRecord::new();
        let read = table.from_reader(&heading[..]).read_byte_record(&mut names);
        read.map_err(|e| unreadable(&e))?;
        Ok(Self {
            header: names.iter().map(name).collect(),
            header_line,
            reader: table.from_reader(source),
            fields: csv::ByteRecord::new(),
            cut: None,
        })
    }

    /// The line within which the file ends, if it does: its row is none.
    #[must_use]
    pub fn cut(&self) -> Option<u64> {
        self.cut
    }

    /// Names of the columns, as they are written.
    #[must_use]
    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// The line of the heading, from 1.
    #[must_use]
    pub fn header_line(&self) -> u64 {
        self.header_line
    }

    /// The next row, with as many fields as the heading; none behind the last one.
    ///
    /// # Errors
    /// What cannot be read, another number of fields.
    pub fn next_row(&mut self) -> Result<Option<Row<'_>>, TableError> {
        let expected = self.header.len();
        loop {
            let read = self.reader.read_byte_record(&mut self.fields);
            // Counted are ends of lines, so that this is the line behind the row.
            let line = self.header_line + self.reader.position().line() - 1;
            let unreadable = |e: csv::Error| TableError::Row {
                line,
                what: e.to_string(),
            };
            if !read.map_err(unreadable)? {
                return Ok(None);
            }
            let is_blank = self.fields.len() == 1 && self.fields[0].trim_ascii().is_empty();
            match self.fields.len() {
                found if found == expected && !is_blank => break,
                _ if is_blank => {}
                found if found < expected && self.is_last()? => {
                    self.cut = Some(line);
                    return Ok(None);
                }
                found => {
                    return Err(TableError::Fields {
                        line,
                        found,
                        expected,
                    });
                }
            }
        }
        let line = self.header_line + self.reader.position().line() - 1;
        let fields = &self.fields;
        Ok(Some(Row { line, fields }))
    }
}

impl<R: Read> TableReader<R> {
    /// Whether the row that was read is the last one, and its line does not end.
    fn is_last(&mut self) -> Result<bool, TableError> {
        if !self.reader.get_ref().get_ref().is_open {
            return Ok(false);
        }
        let more = self.reader.read_byte_record(&mut csv::ByteRecord::new());
        Ok(!more.map_err(|e| TableError::Unreadable(e.to_string()))?)
    }
}

/// A name of the heading; what is not UTF-8 is Latin-1, as older programs write a degree sign.
fn name(field: &[u8]) -> String {
    let field = field.trim_ascii();
    let latin = || field.iter().map(|byte| char::from(*byte)).collect();
    String::from_utf8(field.to_vec()).unwrap_or_else(|_| latin())
}

/// A table that is being written.
pub struct TableWriter<W: Write>(csv::Writer<W>);

impl<W: Write> TableWriter<W> {
    /// Writes the heading.
    ///
    /// # Errors
    /// What `out` says.
    pub fn new<T: AsRef<[u8]>>(out: W, names: impl IntoIterator<Item = T>) -> io::Result<Self> {
        let mut writer = csv::Writer::from_writer(out);
        writer.write_record(names)?;
        Ok(Self(writer))
    }

    /// Writes a row.
    ///
    /// # Errors
    /// What `out` says; another number of fields than the heading has.
    pub fn row<T: AsRef<[u8]>>(&mut self, fields: impl IntoIterator<Item = T>) -> io::Result<()> {
        Ok(self.0.write_record(fields)?)
    }

    /// Writes what is not yet written.
    ///
    /// # Errors
    /// What `out` says.
    pub fn finish(mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// What loggers write where there is no value.
const NOTHING: [&str; 12] = [
    "", "-", "--", "na", "n/a", "#n/a", "<na>", "nan", "nil", "none", "null", "missing",
];

/// A field as a number: NaN where it says that there is none, nothing where it is a text, or digits beyond all numbers.
#[must_use]
pub fn number(field: &str) -> Option<f64> {
    let nothing = || NOTHING.contains(&field.trim().to_ascii_lowercase().as_str());
    match field.parse() {
        Ok(value) => Some(value).filter(|_: &f64| !is_beyond(field, value)),
        Err(_) => nothing().then_some(f64::NAN),
    }
}

/// Whether digits give no finite number; the word `inf` is one.
fn is_beyond(field: &str, value: f64) -> bool {
    value.is_infinite() && field.contains(|c: char| c.is_ascii_digit())
}

/// A number with so many digits after the point. A zero has no sign.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.contains(|c: char| ('1'..='9').contains(&c)) {
        text
    } else {
        text.trim_start_matches('-').into()
    }
}

#[cfg(test)]
mod tests;
