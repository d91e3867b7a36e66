//! The street map of a rural town: a country road around a hill, a village on it, and lanes that branch off.

use crate::streets::network::{Leg, Network};
use crate::streets::profile::Profile;
use crate::streets::ring::Ring;
use crate::streets::street::Street;
use crate::terrain::Terrain;
use nalgebra::Rotation2;
use random::Random;
use std::f64::consts::TAU;

/// Land use along a stretch of the country road.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stretch {
    /// Houses, walls and fences close to the road.
    Village,
    /// Meadows without objects within the detail radius.
    Field,
    /// Trees on one side, a guard rail along the slope on the other.
    Forest,
    /// A tunnel.
    Tunnel,
    /// A canal under the road, a railway across it, and a bridge over it.
    Crossings,
    /// Farms behind rows of trees.
    Farms,
}

/// Number of stretches between the lanes.
const N: usize = 7;
/// The nodes of the round.
const RING: Ring = Ring { radius_m: 255.0, along: 0.12, radii: [0.88, 1.12], heading: 0.2 };

/// The stretches of a rural town, by the number of their street. `all` is used for every stretch outside the village.
pub fn stretches(all: Option<Stretch>) -> [Stretch; N] {
    use Stretch::{Crossings, Farms, Field, Forest, Tunnel, Village};
    let mixed = [Village, Field, Forest, Tunnel, Crossings, Farms, Village];
    mixed.map(|stretch| if stretch == Village { stretch } else { all.unwrap_or(stretch) })
}

/// The map for a seed: streets 0 to 6 form the round of about 1.6 km, the others are lanes that end after 90 to 130 m.
pub fn build(seed: u64, stretches: [Stretch; N]) -> Network {
    let mut random = Random::for_hashed_stream(seed, 0x000c_0a27);
    let terrain = Terrain::new(seed);
    let (mut places, headings) = RING.nodes(N, &mut random);
    let mut streets = Vec::new();
    for k in 0..N {
        let next = (k + 1) % N;
        let profile = if stretches[k] == Stretch::Village { Profile::village() } else { Profile::country() };
        streets.push(Street::new(
            profile,
            [k, next],
            [places[k], places[next]],
            [headings[k], headings[next]],
            terrain,
        ));
    }
    for k in 0..N {
        // Lanes branch off to either side, at right angles.
        let side = if random.chance(0.5) { 1.0 } else { -1.0 };
        let direction = Rotation2::new(side * TAU / 4.0) * headings[k];
        let end = places[k]
            + Rotation2::new(f64::from(random.range(-0.15, 0.15))) * direction * f64::from(random.range(90.0, 130.0));
        places.push(end);
        let is_village = stretches[k] == Stretch::Village;
        let profile = if is_village { Profile::village() } else { Profile::country() };
        let ends = [places[k], end];
        streets.push(Street::new(profile, [k, N + k], ends, [direction, end - places[k]], terrain));
    }
    let mut network = Network::new(terrain, &places, streets, |_| false);
    let is_forward = random.chance(0.5);
    network.round = (0..N).map(|street| Leg { street, is_forward }).collect();
    if !is_forward {
        network.round.reverse();
    }
    network
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn country_round_is_closed_with_a_side_road_at_every_node() {
        for seed in 0..12 {
            let network = build(seed, stretches(None));
            for (k, leg) in network.round.iter().enumerate() {
                let next = network.round[(k + 1) % N];
                assert_eq!(network.node_after(*leg), network.node_after(next.reversed()));
                let [begin, end] = network.mouths(leg.street);
                assert!(end - begin > 110.0, "room for a tunnel: {begin} to {end}");
            }
            assert!(network.nodes[..N].iter().all(|node| node.arms.len() == 3));
            assert_eq!((network.round.len(), network.nodes.len()), (N, 2 * N));
            assert!(network.nodes[N..].iter().all(|node| node.arms.len() == 1));
        }
    }

    #[test]
    fn field_town_has_only_fields_and_a_village() {
        let stretches = stretches(Some(Stretch::Field));
        assert_eq!(stretches.iter().filter(|s| **s == Stretch::Field).count(), N - 2);
    }
}
