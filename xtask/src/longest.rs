//! An upper bound of the number of instructions that the torque path executes, from the machine code of an image.
//!
//! Every instruction counts one, even if a condition skips it. At a branch the longer of both ways counts, whether or
//! not any state takes it. A call counts as the longest path of the called function. A loop counts as many times as
//! [`LOOPS`] allows for the function of the source that has it, which the image's debug information names; any other loop is an error.
//! Memory that is cleared or copied counts by its number of bytes, which has to be a constant. So the bound may be far
//! above the real maximum, but never below it.
//!
//! Not here: which functions may be on the path at all (`code`), and what a step really took (`host-sim ecu pil --count`).
//!
//! Above 500 lines because paths, calls and loops are one recursion, and the allowances stand beside what trusts them: split,
//! a reader could not see why the bound is never below the truth.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use object::{Object, ObjectSection};
use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;

use crate::code::{self, CONTROLLER};
use crate::tool;

/// How often a loop of the source runs at most.
#[derive(Debug, Clone, Copy)]
enum Most {
    Rounds(u64),
    /// Once for each place of a ring of so many; a round may read several places, as the compiler has unrolled it.
    Places(u64),
}

/// Loops of the source, by the function that has them, which may be inlined, and why they run no more often.
const LOOPS: &[(&str, Most, &str)] = &[
    (
        "specialized_div_rem",
        Most::Rounds(64),
        "a bit of a 64-bit quotient each",
    ),
    (
        "line_direction",
        Most::Rounds(6),
        "each halves a ring of 32 places, until nothing is left",
    ),
    (
        "record",
        Most::Rounds(32),
        "each takes a bit of the fault word away",
    ),
    (
        "before",
        Most::Places(64),
        "outputs that the history of torques has",
    ),
];

/// Functions that clear or copy memory, and the register that has the number of bytes.
/// Their loops store words; a loop that stores less in a round has what a round of the widest leaves.
const MEMORY: [(&str, &str); 4] = [
    ("__aeabi_memclr", "r1"),
    ("__aeabi_memset", "r1"),
    ("__aeabi_memcpy", "r2"),
    ("__aeabi_memmove", "r2"),
];

/// Most frames that can arrive within a millisecond: a frame of eight bytes takes at least 222 us at 500 kbit/s, and
/// one may have begun before the millisecond.
pub(crate) const FRAMES_IN_A_TICK: u64 = 5;

/// The bounds, in instructions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Longest {
    /// `Ecu::receive`, one frame.
    pub(crate) receive: u64,
    /// `Ecu::step`.
    pub(crate) step: u64,
    /// Each loop on the way: what it is, how often it runs, and the instructions of a round.
    pub(crate) loops: BTreeSet<(String, u64, u64)>,
}

impl Longest {
    /// A tick with as many frames as the bus can carry.
    pub(crate) const fn tick(&self) -> u64 {
        self.step + FRAMES_IN_A_TICK * self.receive
    }
}

/// # Errors
/// A loop without a bound, or code that cannot be followed.
pub(crate) fn read(elf: &Path) -> Result<Longest> {
    let bytes = fs::read(elf).with_context(|| elf.display().to_string())?;
    let file = object::File::parse(&*bytes).context("no ELF file")?;
    let section = file.section_by_name(".text").context("no section .text")?;
    let text = tool::output(
        tool::llvm("llvm-objdump")?
            .args(["-d", "-C", "--no-show-raw-insn"])
            .arg(elf),
    )?;
    let symbols = addr2line::Loader::new(elf).map_err(|error| anyhow!("{}: {error}", elf.display()))?;
    let inlined = |address| {
        let mut names = Vec::new();
        let mut frames = symbols.find_frames(address).ok();
        while let Some(Ok(Some(frame))) = frames.as_mut().map(|frames| frames.next()) {
            names.extend(frame.function.and_then(|f| Some(f.demangle().ok()?.into_owned())));
        }
        names
    };
    Paths::read(&text, section.address(), section.data()?, &inlined).of_controller()
}

/// The functions of the source that an instruction is from, as they were inlined.
type Inlined<'a> = &'a dyn Fn(u64) -> Vec<String>;

/// An instruction: where, its mnemonic without its width, its operands.
struct Instruction {
    address: u64,
    mnemonic: String,
    operands: String,
}

/// How often a loop runs at most that clears or copies. `widest` has the bytes that the widest loop so far stores in a round: a
/// narrower one has less than that left.
fn rounds_of_memory(members: &[&Instruction], bytes: u64, widest: &Cell<u64>) -> Result<u64> {
    let stride = members.iter().map(|at| at.bytes_stored()).sum();
    ensure!(stride > 0, "a loop that stores nothing");
    let left = if stride < widest.get() {
        bytes.min(widest.get() - 1)
    } else {
        bytes
    };
    widest.set(widest.get().max(stride));
    Ok(left.div_ceil(stride))
}

impl Instruction {
    /// Bytes that it stores.
    fn bytes_stored(&self) -> u64 {
        match self.mnemonic.as_str() {
            "strb" => 1,
            "strh" => 2,
            "str" => 4,
            "strd" => 8,
            "stm" | "stmia" => 4 * (1 + self.operands.matches(',').count() as u64).saturating_sub(1),
            _ => 0,
        }
    }
}

/// The instructions that may follow, as indices in the function, and the function that is called or jumped to.
#[derive(Default)]
struct Flow {
    next: Vec<usize>,
    call: Option<u64>,
}

struct Paths<'a> {
    functions: BTreeMap<u64, (String, Vec<Instruction>)>,
    /// Where the code begins, and its bytes, which hold the tables of branches too.
    start: u64,
    bytes: &'a [u8],
    inlined: Inlined<'a>,
    /// By address, and by the bytes that are cleared or copied.
    known: BTreeMap<(u64, Option<u64>), u64>,
    loops: BTreeSet<(String, u64, u64)>,
}

impl<'a> Paths<'a> {
    fn read(text: &str, start: u64, bytes: &'a [u8], inlined: Inlined<'a>) -> Self {
        let mut functions: BTreeMap<u64, (String, Vec<Instruction>)> = BTreeMap::new();
        let mut here = None;
        for line in text.lines() {
            if let Some((address, name)) = code::head(line) {
                here = Some(address);
                functions.insert(address, (name.to_owned(), Vec::new()));
            } else if let Some((mnemonic, operands)) = code::instruction(line)
                && let Some((_, instructions)) = here.and_then(|address| functions.get_mut(&address))
                && let Some(address) = line.split_once(':').map(|(address, _)| address.trim())
                && let Ok(address) = u64::from_str_radix(address, 16)
            {
                instructions.push(Instruction {
                    address,
                    mnemonic: mnemonic.split('.').next().unwrap_or(mnemonic).to_owned(),
                    operands: operands.to_owned(),
                });
            }
        }
        Self {
            functions,
            start,
            bytes,
            inlined,
            known: BTreeMap::new(),
            loops: BTreeSet::new(),
        }
    }

    fn of_controller(mut self) -> Result<Longest> {
        let [receive, step] = CONTROLLER.map(|root| self.of_root(root));
        Ok(Longest {
            receive: receive?,
            step: step?,
            loops: self.loops,
        })
    }

    fn of_root(&mut self, root: &str) -> Result<u64> {
        let found = self
            .functions
            .iter()
            .find(|(_, (name, _))| name.starts_with(root));
        let address = *found.with_context(|| format!("{root} is not in the image"))?.0;
        self.of_function(address, None)
    }

    /// The longest path through a function and the functions that it calls, or through one that clears or copies so many
    /// bytes. Recursion was refused before, by `code`.
    fn of_function(&mut self, address: u64, bytes: Option<u64>) -> Result<u64> {
        if let Some(known) = self.known.get(&(address, bytes)) {
            return Ok(*known);
        }
        let (name, instructions) = self
            .functions
            .remove(&address)
            .with_context(|| format!("no function at {address:#x}, or it calls itself"))?;
        let flows = self.flows(&instructions).with_context(|| name.clone())?;
        // Padding behind a function is decoded as instructions too, but no instruction leads there.
        let all = reached(&flows);
        let mut costs = vec![0; flows.len()];
        for place in &all {
            costs[*place] = 1;
            if let Some(call) = flows[*place].call {
                let bytes = self.bytes_of(call, &instructions, &flows, &all, *place);
                let bytes = bytes.with_context(|| name.clone())?;
                costs[*place] += self.of_function(call, bytes)?;
            }
        }
        let loops: RefCell<Vec<(String, u64, u64)>> = RefCell::default();
        let widest = Cell::new(1);
        let rounds = |members: &BTreeSet<usize>, once: &dyn Fn() -> Result<u64>| {
            let members: Vec<_> = members.iter().map(|place| &instructions[*place]).collect();
            let (what, rounds) = match bytes {
                Some(bytes) => (
                    format!("{name}, {bytes} bytes"),
                    rounds_of_memory(&members, bytes, &widest)?,
                ),
                None => self.rounds(&members, &name)?,
            };
            let once = once()?;
            loops.borrow_mut().push((what, rounds, once));
            Ok(rounds * once)
        };
        let graph = Graph {
            next: flows.into_iter().map(|flow| flow.next).collect(),
            costs,
            rounds: &rounds,
        };
        let longest = || graph.longest(&all, &BTreeSet::from([0]), &BTreeSet::new());
        if bytes.is_some() {
            // Which loop is the widest is known behind the first time.
            longest().with_context(|| name.clone())?;
            loops.borrow_mut().clear();
        }
        let longest = longest().with_context(|| name.clone())?;
        self.loops.extend(loops.into_inner());
        self.functions.insert(address, (name, instructions));
        self.known.insert((address, bytes), longest);
        Ok(longest)
    }

    /// What a loop is, and how often it runs at most.
    fn rounds(&self, members: &[&Instruction], name: &str) -> Result<(String, u64)> {
        let is_within = |address: u64, function: &str| {
            let mut names = (self.inlined)(address);
            names.push(name.to_owned());
            let mut parts = names.iter().flat_map(|name| name.split("::"));
            parts.any(|part| part.split('<').next() == Some(function))
        };
        let found = LOOPS
            .iter()
            .find(|(function, ..)| members.iter().all(|at| is_within(at.address, function)));
        let Some((function, most, why)) = found else {
            let first = members.first().map_or(0, |at| at.address);
            let within = (self.inlined)(first).join(" in ");
            bail!(
                "a loop of {} instructions at {first:#x} ({within}), and no bound for it",
                members.len()
            );
        };
        let rounds = match most {
            Most::Rounds(rounds) => *rounds,
            Most::Places(places) => {
                let read = members
                    .iter()
                    .filter(|at| at.operands.contains(", lsl #"))
                    .count();
                places.div_ceil(read.max(1) as u64)
            }
        };
        Ok((format!("{function}: {why}"), rounds))
    }

    /// The bytes that a function which is called at a place clears or copies, if it is one that does so.
    fn bytes_of(
        &self,
        function: u64,
        instructions: &[Instruction],
        flows: &[Flow],
        all: &BTreeSet<usize>,
        place: usize,
    ) -> Result<Option<u64>> {
        let name = self.functions.get(&function).map_or("", |(name, _)| name);
        let Some((_, register)) = MEMORY.iter().find(|(start, _)| name.starts_with(start)) else {
            return Ok(None);
        };
        // Back to where the register gets its constant, as long as nothing jumps in between.
        for at in (0..place).rev() {
            let is_target = all
                .iter()
                .any(|from| *from != at && flows[*from].next.contains(&(at + 1)));
            ensure!(!is_target, "{name} of a number of bytes that depends on the way");
            let rest = instructions[at].operands.strip_prefix(register);
            let Some(value) = rest.and_then(|rest| rest.strip_prefix(", ")) else {
                continue;
            };
            let value = value.strip_prefix('#').and_then(|value| {
                let digits = value.split_whitespace().next()?;
                let hexadecimal = digits.strip_prefix("0x");
                hexadecimal.map_or(digits.parse().ok(), |digits| u64::from_str_radix(digits, 16).ok())
            });
            let is_move = ["mov", "movs", "movw"].contains(&instructions[at].mnemonic.as_str());
            return Ok(Some(value.filter(|_| is_move).with_context(|| {
                format!(
                    "{name} of a number of bytes that is no constant: {}",
                    instructions[at].operands
                )
            })?));
        }
        bail!("{name} of a number of bytes from outside")
    }

    fn flows(&self, instructions: &[Instruction]) -> Result<Vec<Flow>> {
        let places: BTreeMap<u64, usize> = (0..).zip(instructions).map(|(i, at)| (at.address, i)).collect();
        let flow = |(i, at): (usize, &Instruction)| {
            let on = (i + 1 < instructions.len()).then_some(i + 1);
            let target = code::any_target(&at.operands);
            let within = target.and_then(|target| places.get(&target).copied());
            let name = at.mnemonic.as_str();
            let (next, call) = match name {
                "tbb" | "tbh" => (self.table(at, &places)?, None),
                "bl" | "blx" => (
                    on.into_iter().collect(),
                    Some(target.context("a call through a register")?),
                ),
                "cbz" | "cbnz" => (on.into_iter().chain(within).collect(), None),
                "b" if within.is_some() => (within.into_iter().collect(), None),
                "b" => (Vec::new(), Some(target.context("a jump to nowhere")?)),
                "bx" | "udf" => (Vec::new(), None),
                "pop" if at.operands.contains("pc") => (Vec::new(), None),
                "ldm" | "ldmia" if at.operands.ends_with("pc}") => (Vec::new(), None),
                "ldr" if at.operands.starts_with("pc,") => bail!("a jump through memory: {}", at.operands),
                _ if is_conditional(name, "b") => {
                    let call = target.filter(|_| within.is_none());
                    (on.into_iter().chain(within).collect(), call)
                }
                // A return on a condition, and everything else.
                _ => (on.into_iter().collect(), None),
            };
            Ok(Flow { next, call })
        };
        instructions.iter().enumerate().map(flow).collect()
    }

    /// The targets of a table branch. The table lies behind the instruction and ends where its first target begins.
    fn table(&self, at: &Instruction, places: &BTreeMap<u64, usize>) -> Result<Vec<usize>> {
        let (base, width) = (at.address + 4, if at.mnemonic == "tbb" { 1 } else { 2 });
        let (mut place, mut end) = (base, u64::MAX);
        let mut targets = BTreeSet::new();
        while place < end {
            let offset = (place - self.start) as usize;
            let entry = self
                .bytes
                .get(offset..offset + width)
                .context("a table beyond the code")?;
            let entry = entry
                .iter()
                .rev()
                .fold(0, |sum, byte| sum << 8 | u64::from(*byte));
            place += width as u64;
            let target = base + 2 * entry;
            // A byte that pads the table to an even length is not an entry.
            if target >= place {
                targets.insert(
                    *places
                        .get(&target)
                        .context("a table that leads out of its function")?,
                );
                end = end.min(target);
            }
        }
        Ok(targets.into_iter().collect())
    }
}

/// The instructions that can be reached from the first one.
fn reached(flows: &[Flow]) -> BTreeSet<usize> {
    let mut reached = BTreeSet::new();
    let mut open = vec![0];
    while let Some(place) = open.pop() {
        if reached.insert(place) {
            open.extend(&flows[place].next);
        }
    }
    reached
}

/// `beq` for `b`, and not `bic`.
fn is_conditional(mnemonic: &str, base: &str) -> bool {
    const CONDITIONS: [&str; 16] = [
        "eq", "ne", "hs", "lo", "cs", "cc", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt", "le",
    ];
    mnemonic
        .strip_prefix(base)
        .is_some_and(|condition| CONDITIONS.contains(&condition))
}

/// What a loop of these instructions takes, by what it takes once.
type OfLoop<'a> = dyn Fn(&BTreeSet<usize>, &dyn Fn() -> Result<u64>) -> Result<u64> + 'a;

/// The instructions of a function, what each costs, and where each leads.
struct Graph<'a> {
    next: Vec<Vec<usize>>,
    costs: Vec<u64>,
    rounds: &'a OfLoop<'a>,
}

impl Graph<'_> {
    /// The longest path through `nodes` from one of `entries`; edges into `closed` are ignored.
    fn longest(
        &self,
        nodes: &BTreeSet<usize>,
        entries: &BTreeSet<usize>,
        closed: &BTreeSet<usize>,
    ) -> Result<u64> {
        let steps = |from: usize| {
            let next = self.next[from].iter().copied();
            next.filter(|to| nodes.contains(to) && !closed.contains(to))
        };
        let groups = groups(nodes, &steps);
        let of: BTreeMap<usize, usize> = (0..)
            .zip(&groups)
            .flat_map(|(group, members)| members.iter().map(move |node| (*node, group)))
            .collect();
        let mut best: Vec<u64> = Vec::with_capacity(groups.len());
        for (group, members) in groups.iter().enumerate() {
            // The groups are sorted so that those after a group were computed before it.
            let leaving = members
                .iter()
                .flat_map(|node| steps(*node))
                .filter(|to| of[to] != group);
            let after = leaving.map(|to| best[of[&to]]).max().unwrap_or(0);
            let first = *members.first().context("an empty group")?;
            let within = if members.len() == 1 && steps(first).all(|to| to != first) {
                self.costs[first]
            } else {
                let entered = nodes
                    .iter()
                    .filter(|node| !members.contains(node))
                    .flat_map(|node| steps(*node));
                let mut doors: BTreeSet<usize> = entered.filter(|to| members.contains(to)).collect();
                doors.extend(entries.intersection(members));
                ensure!(!doors.is_empty(), "a loop that nothing leads to");
                let closed = closed.union(&doors).copied().collect();
                (self.rounds)(members, &|| self.longest(members, &doors, &closed))?
            };
            best.push(within + after);
        }
        entries
            .iter()
            .map(|entry| best[of[entry]])
            .max()
            .context("no way in")
    }
}

/// The groups of nodes that can reach each other (strongly connected components), each after those that it leads to.
fn groups<I: Iterator<Item = usize>>(
    nodes: &BTreeSet<usize>,
    next: &impl Fn(usize) -> I,
) -> Vec<BTreeSet<usize>> {
    let mut graph = DiGraphMap::<usize, ()>::new();
    for node in nodes {
        graph.add_node(*node);
        for to in next(*node) {
            graph.add_edge(*node, to, ());
        }
    }
    let found = tarjan_scc(&graph);
    found
        .into_iter()
        .map(|group| group.into_iter().collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two ways, of three and of one instructions; a call of two; padding that reads as a branch; a loop of three, which may begin eight times; and a
    /// table of two, with a byte that only fills it.
    const TEXT: &str = "
00000100 <haptic_core::ecu::Ecu::receive::h01>:
 100:      \tcmp\tr0, #0x1
 102:      \tbeq\t0x10a <haptic_core::ecu::Ecu::receive::h01+0xa> @ imm = #0x4
 104:      \tmovs\tr1, #0x1
 106:      \tmovs\tr2, #0x1
 108:      \tmovs\tr3, #0x1
 10a:      \tbl\t0x120 <memory> @ imm = #0x10
 10e:      \tpop\t{r4, pc}
 110:      \tbmi\t0x13c <haptic_core::ecu::Ecu::step::h02+0xc> @ imm = #0x28

00000120 <memory>:
 120:      \tmovs\tr0, #0x0
 122:      \tbx\tlr

00000130 <haptic_core::ecu::Ecu::step::h02>:
 130:      \ttbb\t[pc, r0]
 134:      \t<unknown>
 138:      \tnop
 13a:      \tsubs\tr0, #0x1
 13c:      \tpopeq\t{r4, pc}
 13e:      \tb\t0x13a <haptic_core::ecu::Ecu::step::h02+0xa> @ imm = #-0x8
";

    fn paths(text: &str) -> Result<Longest> {
        let mut bytes = [0_u8; 0x40];
        // To 0x138 and 0x13a from 0x134, in halves; then a byte that fills.
        bytes[0x34..0x38].copy_from_slice(&[2, 3, 0, 0]);
        Paths::read(text, 0x100, &bytes, &|address| {
            let is_loop = (0x13a..=0x13e).contains(&address);
            is_loop
                .then(|| "faults::FaultHistory::record".to_owned())
                .into_iter()
                .collect()
        })
        .of_controller()
    }

    #[test]
    fn the_longer_way_calls_tables_and_loops_count() {
        let found = paths(TEXT).unwrap();
        // cmp, beq, three, bl, two of the call, pop.
        assert_eq!(found.receive, 2 + 3 + 1 + 2 + 1);
        // tbb, nop, and a round of three for each bit of the fault word.
        assert_eq!(found.step, 2 + 32 * 3);
        assert_eq!(found.tick(), found.step + 5 * found.receive);
    }

    /// The table above names the lengths of two rings.
    #[test]
    fn rings_are_as_long_as_the_table_says() {
        for (file, places) in [("ramp.rs", 64), ("motion_history.rs", 32)] {
            let path = tool::root().join("core/src/safety").join(file);
            let text = fs::read_to_string(path).unwrap();
            assert!(text.contains(&format!("const RING: usize = {places};")), "{file}");
        }
    }

    /// Twenty bytes, eight a round; what is left one by one.
    const CLEARS: &str = "
00000100 <haptic_core::ecu::Ecu::receive::h01>:
 100:      \tmovs\tr1, #0x14
 102:      \tbl\t0x120 <__aeabi_memclr4> @ imm = #0x1a
 106:      \tbx\tlr

00000120 <__aeabi_memclr4>:
 120:      \tmovs\tr2, #0x0
 122:      \tstrd\tr2, r2, [r0], #8
 124:      \tsubs\tr1, #0x8
 126:      \tbne\t0x122 <__aeabi_memclr4+0x2> @ imm = #-0x8
 128:      \tstrb\tr2, [r0], #0x1
 12a:      \tbne\t0x128 <__aeabi_memclr4+0x8> @ imm = #-0x6
 12c:      \tbx\tlr

00000130 <haptic_core::ecu::Ecu::step::h02>:
 130:      \tbx\tlr
";

    #[test]
    fn memory_counts_by_its_bytes() {
        // movs, bl, bx; movs, three rounds of three, seven of two, bx.
        assert_eq!(paths(CLEARS).unwrap().receive, 3 + 1 + 3 * 3 + 7 * 2 + 1);
        let says = |to: &str| format!("{:#}", paths(&CLEARS.replace("movs\tr1, #0x14", to)).unwrap_err());
        assert!(says("mov\tr1, r4").contains("no constant"));
        assert!(says("cmp\tr4, #0x1").contains("from outside"));
        let jump =
            "beq\t0x102 <haptic_core::ecu::Ecu::receive::h01+0x2> @ imm = #0x0\n 101:      \tmovs\tr1, #0x14";
        assert!(says(jump).contains("depends on the way"));
    }

    #[test]
    fn what_has_no_bound_is_refused() {
        let says = |from: &str, to: &str| format!("{:#}", paths(&TEXT.replace(from, to)).unwrap_err());
        // The same loop where no table allows one.
        let looped = TEXT.replace("movs\tr0, #0x0", "cbz\tr0, 0x120 <memory> @ imm = #0x0");
        assert!(format!("{:#}", paths(&looped).unwrap_err()).contains("no bound for it"));
        assert!(says("bl\t0x120 <memory>", "blx\tr3").contains("a call through a register"));
        assert!(says("bl\t0x120 <memory>", "bl\t0x100 <itself>").contains("calls itself"));
        assert!(says("ecu::Ecu::step", "ecu::Ecu::inlined").contains("is not in the image"));
    }
}
