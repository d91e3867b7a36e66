//! Parameters of the lidar models. [`lidar::velodyne`] defines beams, firing times and packets.

use super::optics::Optics;
use lidar::velodyne::{BLOCKS_PER_PACKET, LASERS_PER_BLOCK, Model};

/// Number of slots (returns) in a packet: 32 for each of 12 blocks.
pub const N_SLOTS: usize = BLOCKS_PER_PACKET * LASERS_PER_BLOCK;

/// Parameters of a rotating lidar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LidarModel {
    /// Beams and packet format.
    pub model: Model,
    /// Revolutions per second.
    pub turns_per_second: f64,
    /// Standard deviation of the encoder's reading, 0.01 deg.
    pub encoder_sigma: f32,
    /// Beam and receiver.
    pub optics: Optics,
}

impl LidarModel {
    /// The HDL-32E at 600 turns per minute, with [`Optics::HDL32E`]. The encoder noise is fitted to a real recording: its
    /// steps scatter by half a count.
    pub const HDL32E: Self =
        Self { model: Model::Hdl32e, turns_per_second: 10.0, encoder_sigma: 0.35, optics: Optics::HDL32E };
    /// The VLP-16 at 600 turns per minute.
    pub const VLP16: Self = Self { model: Model::Vlp16, optics: Optics::VLP16, ..Self::HDL32E };
    /// The VLP-32C at 600 turns per minute.
    pub const VLP32C: Self = Self { model: Model::Vlp32c, optics: Optics::VLP32C, ..Self::HDL32E };
    /// The HDL-64E at 600 turns per minute. Its encoder has no noise.
    pub const HDL64E: Self = Self { model: Model::Hdl64e, encoder_sigma: 0.0, optics: Optics::HDL64E, ..Self::HDL32E };

    /// Parameters of a model.
    pub const fn for_model(model: Model) -> Self {
        match model {
            Model::Hdl32e => Self::HDL32E,
            Model::Vlp16 => Self::VLP16,
            Model::Vlp32c => Self::VLP32C,
            Model::Hdl64e => Self::HDL64E,
        }
    }

    /// Time from one packet to the next, ns.
    pub fn packet_nanos(&self) -> i64 {
        i64::from(self.model.packet_nanos())
    }

    /// Number of packets that cover `seconds`, up to the end of the revolution.
    pub fn n_packets(&self, seconds: f64) -> u64 {
        let turns = (seconds * self.turns_per_second).ceil();
        (turns / self.turns_per_second * 1e9 / self.packet_nanos() as f64).ceil() as u64
    }
}

/// Laser, time and neighbors of a slot of a packet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slot {
    /// Number of the laser in [`Model::lasers`].
    pub laser: usize,
    /// Time of the first firing of its block, ns after the stamp of the packet.
    pub block_nanos: u32,
    /// Time of its firing, ns after the stamp of the packet.
    pub firing_nanos: u32,
    /// Slots of the same laser one round earlier and later; `None` if that round is in another packet.
    pub row_neighbors: [Option<usize>; 2],
    /// Slots of the same round one ring lower and higher; `None` at the edge of the fan.
    pub above: [Option<usize>; 2],
}

/// The slots of a packet.
pub fn slots(model: Model) -> Vec<Slot> {
    let n_lasers = model.n_rings();
    let rings = model.rings();
    // Blocks of an HDL-64E come in pairs that fire simultaneously: lasers 0 to 31 and 32 to 63.
    let blocks_at_once = n_lasers.div_ceil(LASERS_PER_BLOCK);
    let round = n_lasers.min(LASERS_PER_BLOCK);
    let place = |slot: usize| {
        let block = slot / LASERS_PER_BLOCK;
        let in_block = slot % LASERS_PER_BLOCK;
        let laser = in_block % round + block % blocks_at_once * LASERS_PER_BLOCK;
        (block - block % blocks_at_once, in_block / round, laser)
    };
    let slot_of = |(block, nth, laser): (usize, usize, usize)| {
        (block + laser / LASERS_PER_BLOCK) * LASERS_PER_BLOCK + nth * round + laser % LASERS_PER_BLOCK
    };
    let rounds_per_block = LASERS_PER_BLOCK / round;
    (0..N_SLOTS)
        .map(|slot| {
            let (block, nth, laser) = place(slot);
            // Rounds are numbered throughout the packet.
            let number = block / blocks_at_once * rounds_per_block + nth;
            let n_rounds = BLOCKS_PER_PACKET / blocks_at_once * rounds_per_block;
            let at_round = |number: usize| {
                (number < n_rounds)
                    .then(|| slot_of((number / rounds_per_block * blocks_at_once, number % rounds_per_block, laser)))
            };
            let at_ring = |ring: Option<u8>| {
                let other = rings.iter().position(|of| Some(*of) == ring)?;
                Some(slot_of((block, nth, other)))
            };
            let in_block = slot % LASERS_PER_BLOCK;
            Slot {
                laser,
                block_nanos: model.firing_nanos(block, 0),
                firing_nanos: model.firing_nanos(block, in_block),
                row_neighbors: [number.checked_sub(1).and_then(at_round), at_round(number + 1)],
                above: [at_ring(rings[laser].checked_sub(1)), at_ring(Some(rings[laser] + 1))],
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_cover_whole_revolutions() {
        // One revolution of an HDL-32E is 2170.1 rounds, that is 180.8 packets.
        let model = LidarModel::HDL32E;
        assert_eq!([0.1, 0.11, 1.0].map(|seconds| model.n_packets(seconds)), [181, 362, 1809]);
    }

    #[test]
    fn slot_neighbors_are_mutual_and_adjacent() {
        for model in Model::ALL {
            let slots = slots(model);
            let rings = model.rings();
            let mut n_beside = 0;
            for (number, slot) in slots.iter().enumerate() {
                for side in 0..2 {
                    if let Some(other) = slot.row_neighbors[side] {
                        assert_eq!(slots[other].row_neighbors[1 - side], Some(number));
                        assert_eq!(slots[other].laser, slot.laser);
                        assert_eq!(slots[other].firing_nanos > slot.firing_nanos, side == 1);
                        n_beside += 1;
                    }
                    if let Some(other) = slot.above[side] {
                        assert_eq!(slots[other].above[1 - side], Some(number));
                        assert_eq!(slots[other].block_nanos, slot.block_nanos);
                        let step = i32::from(rings[slots[other].laser]) - i32::from(rings[slot.laser]);
                        assert_eq!(step, if side == 0 { -1 } else { 1 });
                    }
                }
            }
            // All rounds except the first and last of the packet have two neighbors.
            assert_eq!(n_beside, 2 * (N_SLOTS - model.n_rings()), "{model:?}");
        }
    }

    #[test]
    fn hdl64e_halves_fire_at_the_same_time() {
        let slots = slots(Model::Hdl64e);
        assert_eq!((slots[0].laser, slots[32].laser, slots[64].laser), (0, 32, 0));
        assert_eq!((slots[0].firing_nanos, slots[32].firing_nanos, slots[64].firing_nanos), (0, 0, 57_600));
    }
}
