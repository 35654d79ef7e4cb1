//! The codes of faults (`haptic_diag::trouble`) in flash, so that a loss of supply does not forget them.
//!
//! They lie in the two pages before those of the starts: a head with the page's number, then an entry for each cell that
//! changed, its place and the cell. The last whole entry of a place counts; one that a cut of the supply left half written is
//! passed over. Memory that a reset left alone is newer than the flash.
//!
//! [`Codes::begin`] runs at a start, where the flash may be erased. If the page has less room than all cells take, the other
//! page is erased and takes them, its head last: until then the old page counts. So a start erases one page at most.
//! [`Codes::keep`] only programs, in the room that is left, and reads nothing: it may run between two ticks. Not here: when
//! it does (`product`).

use embedded_storage::nor_flash::NorFlash;
use haptic_diag::trouble::{CELLS, Cell, Cells, mark};

use crate::keys::{self, page};

/// Pages from the end of the flash to both of these.
const CODES_PAGES: u32 = 9;
/// Bytes of a head, and the most of an entry: whole words of any flash.
const HEAD: u32 = 16;
const LONGEST: usize = 48;

/// Where the next entry goes, and what the flash holds.
pub struct Codes {
    free: u32,
    end: u32,
    /// The CRC of each cell.
    kept: [Option<u32>; CELLS],
}

impl Codes {
    /// Gives cells that hold nothing whole what the flash has of them, and makes room. None where the flash takes nothing.
    #[inline(never)]
    pub fn begin<F: NorFlash>(flash: &mut F, cells: &mut Cells) -> Option<Self> {
        let first = page(flash, CODES_PAGES)?;
        let begins = [first, first + F::ERASE_SIZE as u32];
        let numbers = [number(flash, begins[0]), number(flash, begins[1])];
        let current = usize::from(numbers[1] > numbers[0]);
        let Some(newest) = numbers[current] else {
            return Self::turn(flash, cells, begins[0], 0);
        };
        let mut codes = Self::of::<F>(begins[current]);
        codes.read(flash, cells)?;
        if codes.room::<F>() >= CELLS {
            return Some(codes);
        }
        Self::turn(flash, cells, begins[1 - current], newest.wrapping_add(1))
    }

    /// Stores one cell that changed; false where none did, or there is no room before the next start.
    pub fn keep<F: NorFlash>(&mut self, flash: &mut F, cells: &Cells) -> bool {
        let mut whole = (0..)
            .zip(cells)
            .filter_map(|(place, cell)| Some((place, cell, mark(cell, place)?)));
        let changed = whole.find(|(place, _, mark)| self.kept[*place] != Some(*mark));
        let Some((place, cell, mark)) = changed.filter(|_| self.room::<F>() > 0) else {
            return false;
        };
        let mut entry = [0xFF; LONGEST];
        let words = core::iter::once(place as u32).chain(*cell);
        for (bytes, word) in entry.chunks_exact_mut(4).zip(words) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        let entry = &entry[..length::<F>()];
        if flash.write(self.free, entry).is_ok() {
            self.kept[place] = Some(mark);
        }
        // A word that took only some of its bits is not written again.
        self.free += entry.len() as u32;
        true
    }

    /// A page with nothing but a head.
    fn of<F: NorFlash>(begin: u32) -> Self {
        Self {
            free: begin + HEAD,
            end: begin + F::ERASE_SIZE as u32,
            kept: [None; CELLS],
        }
    }

    /// How many entries have room.
    fn room<F: NorFlash>(&self) -> usize {
        (self.end - self.free) as usize / length::<F>()
    }

    /// Reads the page, up to what is blank to its end.
    fn read<F: NorFlash>(&mut self, flash: &mut F, cells: &mut Cells) -> Option<()> {
        let before = *cells;
        let mut at = self.free;
        while at + length::<F>() as u32 <= self.end {
            let mut entry = [0; LONGEST];
            flash.read(at, &mut entry[..length::<F>()]).ok()?;
            at += length::<F>() as u32;
            if entry[..length::<F>()].iter().any(|byte| *byte != 0xFF) {
                self.free = at;
            }
            let mut words = entry.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes));
            let place = words.next()? as usize;
            let cell = core::array::from_fn(|_| words.next().unwrap_or(0));
            let Some(found) = mark(&cell, place).filter(|_| place < CELLS) else {
                continue;
            };
            self.kept[place] = Some(found);
            if mark(&before[place], place).is_none() {
                cells[place] = cell;
            }
        }
        Some(())
    }

    /// Begins a page with all that is known.
    fn turn<F: NorFlash>(flash: &mut F, cells: &Cells, begin: u32, number: u32) -> Option<Self> {
        let mut codes = Self::of::<F>(begin);
        flash.erase(begin, codes.end).ok()?;
        while codes.keep(flash, cells) {}
        flash.write(begin, &keys::entry(number)).ok()?;
        Some(codes)
    }
}

/// Bytes of an entry.
const fn length<F: NorFlash>() -> usize {
    let length = (4 + size_of::<Cell>()).next_multiple_of(F::WRITE_SIZE);
    const {
        assert!((HEAD as usize).is_multiple_of(F::WRITE_SIZE) && HEAD as usize >= F::READ_SIZE);
    };
    length
}

/// The number of a page, if it has a head.
fn number<F: NorFlash>(flash: &mut F, begin: u32) -> Option<u32> {
    let mut head = [0; HEAD as usize];
    flash.read(begin, &mut head).ok()?;
    let number = u32::from_le_bytes(*head.first_chunk()?);
    (head == keys::entry(number)).then_some(number)
}
