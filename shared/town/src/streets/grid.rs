//! Street maps of towns with blocks: a grid of streets, jittered and bent, and a round through it.

use crate::streets::network::{Leg, Network};
use crate::streets::profile::Profile;
use crate::streets::street::Street;
use crate::terrain::Terrain;
use nalgebra::{Rotation2, Vector2};
use random::Random;

/// Parameters of a grid.
#[derive(Clone, Copy, Debug)]
pub struct GridStyle {
    /// Smallest and largest distance between streets, m.
    pub block_m: [f32; 2],
    /// Largest deviation of nodes from the grid, m.
    pub jitter_m: f32,
    /// Angle by which streets turn at a node, rad.
    pub bend: f32,
    /// Whether streets are between houses, with crosswalks and lights, or between gardens.
    pub is_urban: bool,
}

impl GridStyle {
    /// Grid of blocks of houses.
    pub const URBAN: Self = Self { block_m: [76.0, 112.0], jitter_m: 5.0, bend: 0.06, is_urban: true };
    /// Grid of gardens along curved roads.
    pub const SUBURBAN: Self = Self { block_m: [84.0, 116.0], jitter_m: 11.0, bend: 0.26, is_urban: false };
}

/// Number of blocks along both axes: one around the round on every side.
const N: usize = 6;
/// Number of nodes along both axes.
const NODES: usize = N + 1;

/// The map for a seed. Its round is about 1.5 km long, turns both ways and passes 16 junctions.
pub fn build(seed: u64, style: &GridStyle) -> Network {
    let mut random = Random::for_hashed_stream(seed, 0x0006_71d0);
    let terrain = Terrain::new(seed);
    let places = places(style, &mut random);
    // Streets that continue across a node keep their direction there.
    let mut turns =
        || -> Vec<f64> { (0..NODES * NODES).map(|_| f64::from(random.range(-style.bend, style.bend))).collect() };
    let east_turns = turns();
    let north_turns = turns();
    let axis = (places[node(N, 0)] - places[node(0, 0)]).normalize();
    let street = |from: usize, to: usize, is_east: bool, profile: Profile| {
        let along = if is_east { axis } else { Vector2::new(-axis.y, axis.x) };
        let turns = if is_east { &east_turns } else { &north_turns };
        let directions = [from, to].map(|n| Rotation2::new(turns[n]) * along);
        Street::new(profile, [from, to], [places[from], places[to]], directions, terrain)
    };
    // A street keeps its width through the whole town.
    let mut widths = || [(); NODES].map(|()| f64::from(random.range(2.9, 4.6)));
    let rows = widths();
    let columns = widths();
    let profile = |walk_m: f64| if style.is_urban { Profile::urban(walk_m) } else { Profile::residential() };
    let mut streets = Vec::new();
    for (j, width) in rows.into_iter().enumerate() {
        streets.extend((0..N).map(|i| street(node(i, j), node(i + 1, j), true, profile(width))));
    }
    for (i, width) in columns.into_iter().enumerate() {
        streets.extend((0..N).map(|j| street(node(i, j), node(i, j + 1), false, profile(width))));
    }
    let mut network = Network::new(terrain, &places, streets, |_| style.is_urban);
    network.round = round(&mut random);
    for j in 0..N {
        for i in 0..N {
            let leg = |street, is_forward| Leg { street, is_forward };
            network.blocks.push([
                leg(eastward(i, j), true),
                leg(northward(i + 1, j), true),
                leg(eastward(i, j + 1), false),
                leg(northward(i, j), false),
            ]);
        }
    }
    network
}

const fn node(i: usize, j: usize) -> usize {
    j * NODES + i
}

/// Number of the street from node (i, j) to (i + 1, j).
const fn eastward(i: usize, j: usize) -> usize {
    j * N + i
}

/// Number of the street from node (i, j) to (i, j + 1).
const fn northward(i: usize, j: usize) -> usize {
    NODES * N + i * N + j
}

/// Positions of the nodes: jittered, rotated as a whole, and centered on the origin of the world.
fn places(style: &GridStyle, random: &mut Random) -> Vec<Vector2<f64>> {
    let mut lines = || {
        let mut at = 0.0;
        let mut lines = vec![0.0];
        for _ in 0..N {
            at += f64::from(random.range(style.block_m[0], style.block_m[1]));
            lines.push(at);
        }
        lines.iter().map(|line| line - 0.5 * at).collect::<Vec<f64>>()
    };
    let xs = lines();
    let ys = lines();
    let turn = Rotation2::new(f64::from(random.range(0.0, std::f32::consts::TAU)));
    let mut places = Vec::new();
    for y in ys {
        for x in &xs {
            let mut off = || f64::from(random.range(-style.jitter_m, style.jitter_m));
            places.push(turn * Vector2::new(x + off(), y + off()));
        }
    }
    places
}

/// The round around a square of 4 by 4 blocks with a corner cut out: it turns both ways.
fn round(random: &mut Random) -> Vec<Leg> {
    let cut_x = 1 + random.index(2);
    let cut_y = 1 + random.index(2);
    let low = 1;
    let high = N - 1;
    let corners = [
        (low, low),
        (high, low),
        (high, high - cut_y),
        (high - cut_x, high - cut_y),
        (high - cut_x, high),
        (low, high),
    ];
    let mut legs = Vec::new();
    for (k, &(x0, y0)) in corners.iter().enumerate() {
        let (x1, y1) = corners[(k + 1) % corners.len()];
        if y0 == y1 {
            let leg = |x: usize, is_forward| Leg { street: eastward(x, y0), is_forward };
            if x1 > x0 {
                legs.extend((x0..x1).map(|x| leg(x, true)));
            } else {
                legs.extend((x1..x0).rev().map(|x| leg(x, false)));
            }
        } else {
            let leg = |y: usize, is_forward| Leg { street: northward(x0, y), is_forward };
            if y1 > y0 {
                legs.extend((y0..y1).map(|y| leg(y, true)));
            } else {
                legs.extend((y1..y0).rev().map(|y| leg(y, false)));
            }
        }
    }
    if random.chance(0.5) {
        legs = legs.into_iter().rev().map(Leg::reversed).collect();
    }
    let first = random.index(legs.len());
    legs.rotate_left(first);
    legs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_round_is_closed_and_passes_no_street_twice() {
        for seed in 0..12 {
            for style in [GridStyle::URBAN, GridStyle::SUBURBAN] {
                let network = build(seed, &style);
                let mut length = 0.0;
                for (k, leg) in network.round.iter().enumerate() {
                    let next = network.round[(k + 1) % network.round.len()];
                    assert_eq!(network.node_after(*leg), network.node_after(next.reversed()));
                    assert!(network.round[..k].iter().all(|other| other.street != leg.street));
                    length += network.streets[leg.street].length_m;
                }
                assert!((1200.0..1900.0).contains(&length), "{length} m");
            }
        }
    }

    #[test]
    fn grid_streets_have_length_between_mouths_and_blocks_are_closed() {
        for seed in 0..12 {
            for style in [GridStyle::URBAN, GridStyle::SUBURBAN] {
                let network = build(seed, &style);
                for street in 0..network.streets.len() {
                    let [begin, end] = network.mouths(street);
                    assert!(end - begin > 25.0, "{begin} {end}, seed {seed}, {style:?}");
                }
                for block in &network.blocks {
                    for k in 0..4 {
                        assert_eq!(network.node_after(block[k]), network.node_after(block[(k + 1) % 4].reversed()));
                    }
                }
            }
        }
    }
}
