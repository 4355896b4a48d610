//! Random starts: node positions that roughly suit the lengths, and forces of the right signs.

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tensegra_model::{Configuration, Element, ForceLaw, FormCondition, Interval, Structure};

/// Sweeps that draw the nodes towards the sampled lengths.
const SWEEPS: usize = 30;

/// The generator of one start of a run.
pub(crate) fn generator(seed: u64, start: u64) -> Pcg64 {
    // Another odd multiplier keeps the streams of (seed, start) apart.
    Pcg64::seed_from_u64(
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15)
            .wrapping_add(start.wrapping_mul(0xd1b5_4a32_d192_ed03)),
    )
}

/// A length that an element may have, and lengths that are rather short than long.
fn sample_length(element: &Element, rng: &mut Pcg64) -> f64 {
    let (lo, hi) = (element.length.lo, element.length.hi);
    if element.has_constant_length() {
        lo
    } else if hi.is_finite() {
        lo + (hi - lo) * rng.random_range(0.05..0.6)
    } else {
        lo.max(1e-3) * rng.random_range(1.0..3.0)
    }
}

/// Random positions of all nodes: those that are fixed or prescribed stay, the others are thrown
/// into a ball and drawn by their elements towards the sampled lengths.
pub(crate) fn positions(
    structure: &Structure,
    conditions: &[FormCondition],
    rng: &mut Pcg64,
) -> Vec<Point3<f64>> {
    let count = structure.nodes.len();
    let mut held = vec![[None; 3]; count];
    for coordinate in &structure.fixed {
        held[coordinate.node][coordinate.axis] = Some(coordinate.value);
    }
    if structure.dimension == 2 {
        held.iter_mut().for_each(|held| held[2] = Some(0.0));
    }
    for condition in conditions {
        if let FormCondition::Point { of, at } = condition
            && let [(node, _)] = of[..]
        {
            for (held, at) in held[node].iter_mut().zip(at) {
                *held = held.or(at.filter(Interval::is_constant).map(|at| at.lo));
            }
        }
    }
    let lengths: Vec<f64> = structure
        .elements
        .iter()
        .map(|element| sample_length(element, rng))
        .collect();
    let reach = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
    let center = centre(structure, conditions, &held);
    let mut positions: Vec<Point3<f64>> = held
        .iter()
        .map(|held| {
            let offset = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)) * reach;
            let mut position = center + offset;
            for (value, held) in position.iter_mut().zip(held) {
                *value = held.unwrap_or(*value);
            }
            position
        })
        .collect();
    // Each sweep moves every node to the mean of where its elements would have it.
    let mut wanted = vec![(Vector3::zeros(), 0.0); count];
    for _ in 0..SWEEPS {
        wanted.fill((Vector3::zeros(), 0.0));
        for (element, length) in structure.elements.iter().zip(&lengths) {
            let [a, b] = element.nodes;
            let Some(along) = (positions[b] - positions[a]).try_normalize(0.0) else {
                continue;
            };
            let weight = if element.has_constant_length() {
                4.0
            } else {
                1.0
            };
            for (node, other, sign) in [(a, b, -1.0), (b, a, 1.0)] {
                wanted[node].0 += (positions[other].coords + along * (sign * length)) * weight;
                wanted[node].1 += weight;
            }
        }
        for ((position, (sum, weight)), held) in positions.iter_mut().zip(&wanted).zip(&held) {
            if *weight > 0.0 {
                for axis in 0..3 {
                    if held[axis].is_none() {
                        position[axis] = 0.5 * (position[axis] + sum[axis] / weight);
                    }
                }
            }
        }
    }
    positions
}

/// Where free nodes are thrown: the mean of all coordinates that are known.
fn centre(
    structure: &Structure,
    conditions: &[FormCondition],
    held: &[[Option<f64>; 3]],
) -> Point3<f64> {
    let mut sums = [(0.0, 0.0); 3];
    let mut add = |axis: usize, value: f64, weight: f64| {
        sums[axis].0 += weight * value;
        sums[axis].1 += weight;
    };
    for held in held {
        for (axis, value) in held.iter().enumerate() {
            if let Some(value) = value {
                add(axis, *value, 1.0);
            }
        }
    }
    for condition in conditions {
        if let FormCondition::Point { of, at } = condition
            && of.len() > 1
        {
            for (axis, value) in at.iter().enumerate().take(structure.dimension) {
                if let Some(range) = value {
                    let middle = 0.5 * (range.lo + range.hi);
                    if middle.is_finite() {
                        add(axis, middle, of.len() as f64);
                    }
                }
            }
        }
    }
    let mean = |(sum, weight): (f64, f64)| if weight > 0.0 { sum / weight } else { 0.0 };
    Point3::from(sums.map(mean))
}

/// A configuration at the positions with random forces: of the sign that each element's range
/// prefers, of the order of `force`.
pub(crate) fn configuration(
    structure: &Structure,
    positions: Vec<Point3<f64>>,
    force: f64,
    rng: &mut Pcg64,
) -> Configuration {
    let lengths: Vec<f64> = structure
        .elements
        .iter()
        .map(|element| {
            let [a, b] = element.nodes;
            (positions[b] - positions[a]).norm().max(f64::MIN_POSITIVE)
        })
        .collect();
    let share = force / (structure.elements.len() as f64).sqrt();
    let forces: Vec<Option<f64>> = structure
        .elements
        .iter()
        .zip(&lengths)
        .map(|(element, length)| {
            let size = share * rng.random_range(0.3..1.5);
            match element.law {
                ForceLaw::None => None,
                ForceLaw::Linear { stiffness, rest } if rest.is_constant() => {
                    Some(stiffness * (length - rest.lo))
                }
                _ => {
                    let (lo, hi) = (element.force.lo, element.force.hi);
                    let sign = if hi <= 0.0 {
                        -1.0
                    } else if lo >= 0.0 || rng.random_range(0.0..1.0) < 0.5 {
                        1.0
                    } else {
                        -1.0
                    };
                    Some((sign * size).clamp(lo, hi))
                }
            }
        })
        .collect();
    let rest_lengths = structure
        .elements
        .iter()
        .zip(lengths.iter().zip(&forces))
        .map(|(element, (length, force))| match (element.law, force) {
            (ForceLaw::Linear { stiffness, .. }, Some(force)) => Some(length - force / stiffness),
            _ => None,
        })
        .collect();
    Configuration {
        positions,
        lengths,
        rest_lengths,
        forces,
    }
}
