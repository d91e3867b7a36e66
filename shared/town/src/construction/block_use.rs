//! Uses of the blocks between streets.

use crate::kind::Town;
use crate::streets::network::Network;
use random::Random;

/// Use of the block between four streets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockUse {
    /// Houses around a yard.
    Houses,
    /// Houses in gardens.
    Gardens,
    /// Open and paved: a fountain, stalls, trees, people.
    Square,
    /// Lawns and trees behind a fence.
    Park,
}

impl BlockUse {
    /// The uses of the blocks of a town: one in seven is a square, one in seven a park.
    pub fn per_block(network: &Network, kind: Town, random: &mut Random) -> Vec<Self> {
        let usual = if kind == Town::Urban { Self::Houses } else { Self::Gardens };
        let draw = |random: &mut Random| match random.index(7) {
            0 if kind == Town::Urban => Self::Square,
            1 => Self::Park,
            _ => usual,
        };
        network.blocks.iter().map(|_| draw(random)).collect()
    }
    pub const fn has_houses(self) -> bool {
        matches!(self, Self::Houses)
    }
}
