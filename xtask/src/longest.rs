//! An upper bound of the number of instructions that the torque path executes, from the machine code of an image.
//!
//! Every instruction counts one, even if a condition skips it. At a branch the longer of both ways counts, whether or
//! not any state takes it. A call counts as the longest path of the called function. A loop counts as many times as
//! [`LOOPS`] allows; a loop in a function that is not in that table is an error. So the bound may be far above the
//! real maximum, but never below it.
//!
//! Not here: which functions may be on the path at all (`code`), and what a step really took (`host-sim ecu pil --count`).

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use object::{Object, ObjectSection};
use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;

use crate::code::{self, CONTROLLER};
use crate::tool;

/// How many times a loop of a function can run, and why. The first entry is the beginning of the function's name.
const LOOPS: &[(&str, u64, &str)] = &[
    // The longest it clears or copies is the parameters' own memory.
    (
        "__aeabi_mem",
        64,
        "words of the largest value that is cleared or copied as one",
    ),
    (
        "compiler_builtins::int::specialized_div_rem",
        64,
        "a bit of a 64-bit quotient each",
    ),
    (
        "haptic_core::",
        64,
        "the history of torques has so many places, and nothing else that a step goes through more",
    ),
];

/// Most frames that can arrive within a millisecond: a frame of eight bytes takes at least 222 us at 500 kbit/s, and
/// one may have begun before the millisecond.
pub(crate) const FRAMES_IN_A_TICK: u64 = 5;

/// The bounds, in instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Longest {
    /// `Ecu::receive`, one frame.
    pub(crate) receive: u64,
    /// `Ecu::step`.
    pub(crate) step: u64,
}

impl Longest {
    /// A tick with as many frames as the bus can carry.
    pub(crate) const fn tick(self) -> u64 {
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
    let mut code = Paths::read(&text, section.address(), section.data()?);
    let [receive, step] = CONTROLLER.map(|root| code.of_root(root));
    Ok(Longest {
        receive: receive?,
        step: step?,
    })
}

/// An instruction: where, its mnemonic without its width, its operands.
struct Instruction {
    address: u64,
    mnemonic: String,
    operands: String,
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
    known: BTreeMap<u64, u64>,
}

impl<'a> Paths<'a> {
    fn read(text: &str, start: u64, bytes: &'a [u8]) -> Self {
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
            known: BTreeMap::new(),
        }
    }

    fn of_root(&mut self, root: &str) -> Result<u64> {
        let found = self
            .functions
            .iter()
            .find(|(_, (name, _))| name.starts_with(root));
        let address = *found.with_context(|| format!("{root} is not in the image"))?.0;
        self.of_function(address)
    }

    /// The longest path through a function and the functions that it calls. Recursion was refused before, by `code`.
    fn of_function(&mut self, address: u64) -> Result<u64> {
        if let Some(known) = self.known.get(&address) {
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
            let call = flows[*place].call;
            costs[*place] = 1 + call.map_or(Ok(0), |call| self.of_function(call))?;
        }
        let bound = LOOPS.iter().find(|(start, ..)| name.starts_with(start));
        let graph = Graph {
            next: flows.into_iter().map(|flow| flow.next).collect(),
            costs,
            rounds: bound.map(|(_, rounds, _)| *rounds),
        };
        let longest = graph
            .longest(&all, &BTreeSet::from([0]), &BTreeSet::new())
            .with_context(|| name.clone())?;
        self.functions.insert(address, (name, instructions));
        self.known.insert(address, longest);
        Ok(longest)
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

/// The instructions of a function, what each costs, and where each leads.
struct Graph {
    next: Vec<Vec<usize>>,
    costs: Vec<u64>,
    /// How many times a loop may run; `None` if there must be no loop.
    rounds: Option<u64>,
}

impl Graph {
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
                let Some(rounds) = self.rounds else {
                    bail!("a loop of {} instructions, and no bound for it", members.len());
                };
                let entered = nodes
                    .iter()
                    .filter(|node| !members.contains(node))
                    .flat_map(|node| steps(*node));
                let mut doors: BTreeSet<usize> = entered.filter(|to| members.contains(to)).collect();
                doors.extend(entries.intersection(members));
                ensure!(!doors.is_empty(), "a loop that nothing leads to");
                rounds * self.longest(members, &doors, &closed.union(&doors).copied().collect())?
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
        let mut code = Paths::read(text, 0x100, &bytes);
        let [receive, step] = CONTROLLER.map(|root| code.of_root(root));
        Ok(Longest {
            receive: receive?,
            step: step?,
        })
    }

    #[test]
    fn the_longer_way_calls_tables_and_loops_count() {
        let found = paths(TEXT).unwrap();
        // cmp, beq, three, bl, two of the call, pop.
        assert_eq!(found.receive, 2 + 3 + 1 + 2 + 1);
        // tbb, nop, and 64 rounds of three.
        assert_eq!(found.step, 2 + 64 * 3);
        assert_eq!(found.tick(), found.step + 5 * found.receive);
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
