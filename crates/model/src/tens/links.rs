//! `.links` files: one configuration a row, in the coordinates of a structure
//! before any simplification.
//!
//! A row holds, for each element in order of declaration, its direction (3), its
//! length if that varies, its rest length if its force follows a linear law, and
//! its force if it carries one; then the frame of each attachment (12), the
//! position of each node that lies on no cycle of elements (3), and the position
//! of the first node of a free-flying structure (3; 2 in the plane).
//!
//! Node positions follow along a spanning tree of the elements. What a row says
//! twice must agree, which shows a row that was written for another structure or
//! another pretension.

use std::{collections::VecDeque, ops::Range};

use nalgebra::{Point3, Vector3};

use crate::{
    diagnostic::{Finding, Findings, Severity, SourceFile},
    problem::Endpoint,
    structure::{ForceLaw, Structure},
};

/// Relative error up to which statements of a row count as equal.
const AGREEMENT: f64 = 1e-4;

/// Reads row `row`, counted from one, of a file. Nothing if there is no such row,
/// or if it has been reported as wrong.
pub(crate) fn read_row(
    file: &SourceFile,
    row: usize,
    structure: &Structure,
    findings: &mut Findings,
) -> Option<Endpoint> {
    let (numbers, spans, whole) = numbers(file, row, findings)?;
    let expected = row_length(structure);
    if numbers.len() != expected {
        let message = format!(
            "row {row} holds {} numbers, but a configuration of this structure has {expected}",
            numbers.len()
        );
        let hint = "a row lists direction, length, rest length and force of every element, in order of declaration, as far as each varies".to_string();
        report(file, findings, whole, message, hint);
        return None;
    }
    let row = decode(&numbers, structure);
    match row.check(structure) {
        None => Some(Endpoint {
            positions: row.positions,
            forces: row.forces,
            rest_lengths: row.rest_lengths,
        }),
        Some((number, message)) => {
            let span = number.map_or(whole, |index| spans[index].clone());
            let hint = "the row was written for another structure or other parameters".to_string();
            report(file, findings, span, message, hint);
            None
        }
    }
}

fn report(
    file: &SourceFile,
    findings: &mut Findings,
    span: Range<usize>,
    message: String,
    hint: impl Into<Option<String>>,
) {
    findings.push(Finding::in_text(Severity::Error, file, span, message).with_hint(hint));
}

type Numbers = (Vec<f64>, Vec<Range<usize>>, Range<usize>);

/// The numbers of a row, where each stands, and where the row stands.
fn numbers(file: &SourceFile, row: usize, findings: &mut Findings) -> Option<Numbers> {
    let text = file.text();
    let offset_in_text = |part: &str| part.as_ptr() as usize - text.as_ptr() as usize;
    let line = text
        .lines()
        .filter(|line| !line.trim().is_empty())
        .nth(row.checked_sub(1)?)?;
    let start = offset_in_text(line);
    let whole = start..start + line.trim_end().len();
    let mut numbers = Vec::new();
    let mut spans = Vec::new();
    for word in line.split_whitespace() {
        let start = offset_in_text(word);
        let span = start..start + word.len();
        match word.parse::<f64>() {
            Ok(value) if value.is_finite() => {
                numbers.push(value);
                spans.push(span);
            }
            _ => {
                let message = format!("`{word}` is no finite number");
                report(file, findings, span, message, None);
                return None;
            }
        }
    }
    Some((numbers, spans, whole))
}

/// How many numbers a row of a structure holds.
fn row_length(structure: &Structure) -> usize {
    let elements: usize = structure
        .elements
        .iter()
        .map(|element| {
            let linear = matches!(element.law, ForceLaw::Linear { .. });
            3 + usize::from(!element.has_constant_length())
                + usize::from(linear)
                + usize::from(element.carries_force())
        })
        .sum();
    let free_nodes = on_a_cycle(structure)
        .iter()
        .filter(|cyclic| !**cyclic)
        .count();
    let base = if structure.base_range.is_some() {
        structure.dimension
    } else {
        0
    };
    elements + 12 * structure.attachments.len() + 3 * free_nodes + base
}

/// What a row says.
struct Row {
    directions: Vec<Vector3<f64>>,
    lengths: Vec<f64>,
    rest_lengths: Vec<Option<f64>>,
    forces: Vec<Option<f64>>,
    positions: Vec<Point3<f64>>,
    /// Index of the first number of each element.
    first: Vec<usize>,
}

fn decode(numbers: &[f64], structure: &Structure) -> Row {
    let elements = &structure.elements;
    let mut row = Row {
        directions: Vec::with_capacity(elements.len()),
        lengths: Vec::with_capacity(elements.len()),
        rest_lengths: Vec::with_capacity(elements.len()),
        forces: Vec::with_capacity(elements.len()),
        positions: Vec::new(),
        first: Vec::with_capacity(elements.len()),
    };
    let mut at = 0;
    let mut next = || {
        at += 1;
        numbers[at - 1]
    };
    let mut first = 0;
    for element in elements {
        row.first.push(first);
        row.directions.push(Vector3::new(next(), next(), next()));
        first += 3;
        let mut next_if = |present: bool| {
            first += usize::from(present);
            present.then(&mut next)
        };
        let length = next_if(!element.has_constant_length());
        row.lengths.push(length.unwrap_or(element.length.lo));
        let linear = matches!(element.law, ForceLaw::Linear { .. });
        row.rest_lengths.push(next_if(linear));
        row.forces.push(next_if(element.carries_force()));
    }
    let mut origin = Point3::origin();
    if structure.base_range.is_some() {
        let base = &numbers[numbers.len() - structure.dimension..];
        for (axis, value) in base.iter().enumerate() {
            origin[axis] = *value;
        }
    }
    for fixed in structure.fixed.iter().filter(|fixed| fixed.node == 0) {
        origin[fixed.axis] = fixed.value;
    }
    row.positions = positions(structure, origin, &row.directions, &row.lengths);
    row
}

/// Elements and neighbours of each node: (element, neighbour, +1 or −1).
fn neighbours(structure: &Structure) -> Vec<Vec<(usize, usize, f64)>> {
    let mut neighbours = vec![Vec::new(); structure.nodes.len()];
    for (index, element) in structure.elements.iter().enumerate() {
        let [a, b] = element.nodes;
        neighbours[a].push((index, b, 1.0));
        neighbours[b].push((index, a, -1.0));
    }
    neighbours
}

/// Positions of the nodes along the breadth-first tree from the first one.
fn positions(
    structure: &Structure,
    origin: Point3<f64>,
    directions: &[Vector3<f64>],
    lengths: &[f64],
) -> Vec<Point3<f64>> {
    let neighbours = neighbours(structure);
    let mut positions = vec![origin; structure.nodes.len()];
    let mut reached = vec![false; structure.nodes.len()];
    reached[0] = true;
    let mut queue = VecDeque::from([0]);
    while let Some(node) = queue.pop_front() {
        for &(element, neighbour, sign) in &neighbours[node] {
            if !reached[neighbour] {
                reached[neighbour] = true;
                positions[neighbour] =
                    positions[node] + directions[element] * (sign * lengths[element]);
                queue.push_back(neighbour);
            }
        }
    }
    positions
}

impl Row {
    /// What in the row contradicts itself or the structure: the number concerned,
    /// if it is one, and why.
    fn check(&self, structure: &Structure) -> Option<(Option<usize>, String)> {
        let size = self.lengths.iter().fold(0.0_f64, |size, l| size.max(*l));
        let norm = self
            .forces
            .iter()
            .flatten()
            .map(|force| force * force)
            .sum::<f64>()
            .sqrt();
        for (index, element) in structure.elements.iter().enumerate() {
            let direction = self.directions[index];
            let name = &element.name;
            let out_of_plane = structure.dimension == 2 && direction.z.abs() > AGREEMENT;
            if (direction.norm() - 1.0).abs() > AGREEMENT || out_of_plane {
                let message = format!(
                    "here the direction of `{name}` begins, but it is no unit vector{}",
                    if out_of_plane { " in the plane" } else { "" }
                );
                return Some((Some(self.first[index]), message));
            }
        }
        if let Some(pretension) = structure.pretension
            && (norm - pretension).abs() > AGREEMENT * pretension
        {
            let message = format!(
                "the forces of this row have the norm {norm:.6}, but the pretension is {pretension}"
            );
            return Some((None, message));
        }
        for (index, element) in structure.elements.iter().enumerate() {
            let name = &element.name;
            if let (ForceLaw::Linear { stiffness, .. }, Some(rest), Some(force)) =
                (element.law, self.rest_lengths[index], self.forces[index])
            {
                let hooke = stiffness * (self.lengths[index] - rest);
                // What rounding of a length does to the force counts as agreement.
                let slack = AGREEMENT * norm.max(stiffness.abs() * size);
                if (hooke - force).abs() > slack {
                    let message =
                        format!("the force {force} of `{name}` is not k (l − r) = {hooke:.6}");
                    // Direction, length and rest length come before the force.
                    return Some((Some(self.first[index] + 5), message));
                }
            }
            let [a, b] = element.nodes.map(|node| self.positions[node]);
            let gap = (b - a - self.directions[index] * self.lengths[index]).norm();
            if gap > AGREEMENT * size {
                let message = format!(
                    "`{name}` does not join its nodes: its ends are {gap:.6} apart from them"
                );
                return Some((Some(self.first[index]), message));
            }
        }
        None
    }
}

/// For each node, whether it lies on a cycle of elements.
///
/// An element lies on a cycle unless it is a bridge; bridges are found by Tarjan's
/// low points, without recursion.
fn on_a_cycle(structure: &Structure) -> Vec<bool> {
    let neighbours = neighbours(structure);
    let count = structure.nodes.len();
    let mut order = vec![usize::MAX; count];
    let mut low = vec![usize::MAX; count];
    let mut cyclic = vec![false; count];
    let mut visited = 0;
    for root in 0..count {
        if order[root] != usize::MAX {
            continue;
        }
        // (node, element it was reached by, next neighbour to look at)
        let mut stack = vec![(root, usize::MAX, 0)];
        order[root] = visited;
        low[root] = visited;
        visited += 1;
        while let Some(&mut (node, entry, ref mut next)) = stack.last_mut() {
            if let Some(&(element, neighbour, _)) = neighbours[node].get(*next) {
                *next += 1;
                if element == entry {
                    continue;
                }
                if order[neighbour] == usize::MAX {
                    order[neighbour] = visited;
                    low[neighbour] = visited;
                    visited += 1;
                    stack.push((neighbour, element, 0));
                } else {
                    low[node] = low[node].min(order[neighbour]);
                    cyclic[node] = true;
                    cyclic[neighbour] = true;
                }
            } else {
                stack.pop();
                if let Some(&(parent, ..)) = stack.last() {
                    low[parent] = low[parent].min(low[node]);
                    if low[node] <= order[parent] {
                        cyclic[node] = true;
                        cyclic[parent] = true;
                    }
                }
            }
        }
    }
    cyclic
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builder::StructureBuilder;

    /// A triangle a b c with a tail c d e.
    fn triangle_with_tail() -> Structure {
        StructureBuilder::planar()
            .strut("s1", ["a", "b"], 1.0)
            .cable("c1", ["b", "c"], 0.0..=2.0, 1.0, 0.0..=2.0)
            .inextensible_cable("c2", ["c", "a"], 1.0)
            .bar("t1", ["c", "d"], 1.0)
            .bar("t2", ["d", "e"], 2.0)
            .fix("a", [3.0, 4.0, 0.0])
            .pretension(None)
            .build()
            .unwrap()
    }

    /// A row of that structure with a right angle at a.
    const ROW: &str = "1 0 0 -2  -0.7071067811865475 0.7071067811865475 0 1.4142135623730951 1 0.4142135623730951 \
         0 -1 0 0.5  1 0 0 0  0 1 0 0  4 5 0 4 7 0";

    fn read(text: &str, row: usize, structure: &Structure) -> Result<Option<Endpoint>, String> {
        let file = SourceFile::new("a.links", text);
        let mut findings = Findings::default();
        let endpoint = read_row(&file, row, structure, &mut findings);
        findings
            .finish()
            .map(|_| endpoint)
            .map_err(|errors| format!("{errors:#}"))
    }

    #[test]
    fn rows_give_positions_forces_and_rest_lengths() {
        let structure = triangle_with_tail();
        let text = format!("\n{ROW}\n\n{ROW}\nthe rest is not looked at");
        for row in [1, 2] {
            let endpoint = read(&text, row, &structure).unwrap().unwrap();
            let expected = [[3.0, 4.0], [4.0, 4.0], [3.0, 5.0], [4.0, 5.0], [4.0, 7.0]];
            for (position, [x, y]) in endpoint.positions.iter().zip(expected) {
                assert!((position - Point3::new(x, y, 0.0)).norm() < 1e-15);
            }
            let cable = 0.414_213_562_373_095_1;
            let forces = [-2.0, cable, 0.5, 0.0, 0.0].map(Some);
            assert_eq!(endpoint.forces, forces);
            assert_eq!(endpoint.rest_lengths, [None, Some(1.0), None, None, None]);
        }
        assert_eq!(read(&text, 9, &structure), Ok(None));
    }

    #[test]
    fn a_free_flying_row_ends_with_the_base() {
        let structure = StructureBuilder::planar()
            .bar("a", ["p", "q"], 1.0)
            .bar("b", ["q", "r"], 1.0)
            .bar("c", ["r", "p"], 1.0)
            .free_flying([2.0, 2.0, 0.0])
            .pretension(None)
            .build()
            .unwrap();
        let h = 3.0_f64.sqrt() / 2.0;
        let row = format!("1 0 0 0 -0.5 {h} 0 0 -0.5 -{h} 0 0 0.25 -1");
        let endpoint = read(&row, 1, &structure).unwrap().unwrap();
        assert_eq!(endpoint.positions[0], Point3::new(0.25, -1.0, 0.0));
        assert_eq!(endpoint.positions[1], Point3::new(1.25, -1.0, 0.0));
    }

    #[test]
    fn rows_of_another_structure_or_pretension_are_refused() {
        let mut structure = triangle_with_tail();
        let error = |text: &str, structure: &Structure| read(text, 1, structure).unwrap_err();
        assert!(error("1 2 3", &structure).contains("holds 3 numbers"));
        assert!(error("1 2 x", &structure).starts_with("a.links:1:5: `x` is no finite number"));
        assert!(error("1 NaN 3", &structure).contains("no finite number"));
        assert!(error(&ROW.replacen('1', "2", 1), &structure).contains("no unit vector"));
        let limp = ROW.replace("1 0.4142135623730951", "0.5 0.4142135623730951");
        assert!(error(&limp, &structure).contains("is not k (l − r)"));
        let open = ROW.replace("0 -1 0 0.5", "0 1 0 0.5");
        assert!(error(&open, &structure).contains("does not join its nodes"));
        structure.pretension = Some(4.0);
        assert!(error(ROW, &structure).contains("the pretension is 4"));
    }

    #[test]
    fn nodes_on_cycles_are_found() {
        let cyclic = on_a_cycle(&triangle_with_tail());
        assert_eq!(cyclic, [true, true, true, false, false]);
        // Two elements between the same nodes form a cycle.
        let double = StructureBuilder::planar()
            .bar("a", ["p", "q"], 1.0)
            .bar("b", ["q", "p"], 1.0)
            .bar("c", ["q", "r"], 1.0)
            .build()
            .unwrap();
        assert_eq!(on_a_cycle(&double), [true, true, false]);
    }
}
