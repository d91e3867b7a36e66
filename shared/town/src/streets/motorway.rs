//! The street map of a motorway: one closed round of wide bends, without junctions.

use crate::streets::network::{Leg, Network};
use crate::streets::profile::Profile;
use crate::streets::ring::Ring;
use crate::streets::street::Street;
use crate::terrain::Terrain;
use random::Random;

/// Number of streets of the round.
const N: usize = 14;
/// Wide bends: the radius of the road is at least 350 m.
const RING: Ring = Ring { radius_m: 900.0, along: 0.1, radii: [0.98, 1.02], heading: 0.04 };

/// The map for a seed: a round of about 5.7 km with two or three lanes each way.
pub fn build(seed: u64) -> Network {
    let mut random = Random::for_hashed_stream(seed, 0x0307_042a);
    let terrain = Terrain::new(seed);
    let profile = Profile::motorway(if random.chance(0.6) { 2 } else { 3 });
    let (places, headings) = RING.nodes(N, &mut random);
    let street = |k: usize| {
        let next = (k + 1) % N;
        Street::new(profile, [k, next], [places[k], places[next]], [headings[k], headings[next]], terrain)
    };
    let mut network = Network::new(terrain, &places, (0..N).map(street).collect(), |_| false);
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
    use crate::streets::lane;

    #[test]
    fn motorway_goes_on_through_its_nodes_in_wide_bends() {
        for seed in 0..12 {
            let network = build(seed);
            for street in 0..N {
                let [begin, end] = network.mouths(street);
                assert_eq!([begin, end], [0.0, network.streets[street].length_m], "no junctions");
            }
            for t in network.streets[0].profile.lanes_t() {
                let lane = lane::around(&network, &network.round, -t).expect("legs");
                let n = lane.path.length_m() as usize;
                let sharpest = (0..n).map(|i| lane.path.curvature(i as f64).abs()).fold(0.0, f64::max);
                assert!(sharpest < 1.0 / 350.0, "radius {} m, seed {seed}", 1.0 / sharpest);
                assert!((5000..6400).contains(&n), "{n} m");
            }
        }
    }
}
