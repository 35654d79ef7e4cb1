//! How deep the groups of a file's schema are nested. The crate parquet builds them by recursion, as deep as the file says, and a
//! stack that overflows ends the process. So the footer (Thrift's compact protocol) is looked at before, up to its schema.

/// Deepest schema that is read: a table has one level, and columns of lists and records a few more.
const DEEPEST: usize = 64;

/// Kinds of Thrift.
const LIST: u8 = 9;
const STRUCT: u8 = 12;
/// Fields of the footer and of an element of its schema.
const SCHEMA: i64 = 2;
const CHILDREN: i64 = 5;

/// Whether the file has a footer with a schema that is not nested too deep.
pub(super) fn is_shallow(file: &[u8]) -> bool {
    let footer = || {
        let (rest, end) = file.split_last_chunk::<8>()?;
        let [a, b, c, d, ..] = *end;
        rest.get(
            rest.len()
                .checked_sub(u32::from_le_bytes([a, b, c, d]) as usize)?..,
        )
    };
    footer()
        .and_then(|footer| Footer(footer).is_shallow())
        .unwrap_or(false)
}

/// What is not yet read of it.
struct Footer<'a>(&'a [u8]);

impl Footer<'_> {
    fn is_shallow(&mut self) -> Option<bool> {
        let mut number = 0;
        loop {
            match self.field(&mut number)? {
                LIST if number == SCHEMA => break,
                0 => return None,
                kind => self.skip(kind, 0)?,
            }
        }
        let (elements, _) = self.list()?;
        // Children that the groups above still have.
        let mut above: Vec<u64> = Vec::new();
        for _ in 0..elements {
            while above.last() == Some(&0) {
                above.pop();
            }
            if let Some(left) = above.last_mut() {
                *left -= 1;
            }
            let (mut number, mut children) = (0, 0);
            loop {
                match self.field(&mut number)? {
                    0 => break,
                    4..=6 if number == CHILDREN => children = self.number()? / 2,
                    kind => self.skip(kind, 0)?,
                }
            }
            if children > 0 {
                above.push(children);
            }
            if above.len() > DEEPEST {
                return Some(false);
            }
        }
        Some(true)
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn pass(&mut self, bytes: u64) -> Option<()> {
        self.0 = self.0.get(usize::try_from(bytes).ok()?..)?;
        Some(())
    }

    fn number(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return Some(number);
            }
        }
        None
    }

    /// The kind of the next field, 0 at the end; its number counts on from the last one's.
    fn field(&mut self, number: &mut i64) -> Option<u8> {
        let byte = self.byte()?;
        *number = match byte >> 4 {
            0 if byte != 0 => (self.number()? / 2) as i64,
            step => number.checked_add(step.into())?,
        };
        Some(byte & 15)
    }

    /// How many there are, and of which kind.
    fn list(&mut self) -> Option<(u64, u8)> {
        let byte = self.byte()?;
        let count = match byte >> 4 {
            15 => self.number()?,
            few => few.into(),
        };
        Some((count, byte & 15))
    }

    fn skip(&mut self, kind: u8, depth: usize) -> Option<()> {
        match kind {
            _ if depth > DEEPEST => None,
            1 | 2 => Some(()),
            3 => self.pass(1),
            4..=6 => self.number().map(drop),
            7 => self.pass(8),
            8 => {
                let bytes = self.number()?;
                self.pass(bytes)
            }
            LIST => {
                let (count, kind) = self.list()?;
                (0..count).try_for_each(|_| match kind {
                    1 | 2 => self.pass(1),
                    _ => self.skip(kind, depth + 1),
                })
            }
            STRUCT => {
                let mut number = 0;
                loop {
                    match self.field(&mut number)? {
                        0 => return Some(()),
                        kind => self.skip(kind, depth + 1)?,
                    }
                }
            }
            _ => None,
        }
    }
}
