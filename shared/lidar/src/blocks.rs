//! Firing times of the blocks of a packet, and the encoder angles at which they start.

/// Most blocks of a packet.
pub(crate) const MAX_BLOCKS: usize = 16;
/// Marks a block that cannot be decoded.
const INVALID: u16 = u16::MAX;
/// Marks a block without data.
const EMPTY: u16 = u16::MAX - 1;

/// The blocks of a packet, in the order of their firing.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Blocks {
    len: usize,
    /// First firing, ns after the time of the packet.
    nanos: [i32; MAX_BLOCKS],
    turned: [u16; MAX_BLOCKS],
    /// Time from the first firing of the packet to the first firing of the next packet, ns.
    pub(crate) packet_nanos: i64,
    /// Time from the first firing of a block to the first firing of the next block, ns.
    pub(crate) block_nanos: i64,
}

impl Blocks {
    /// No blocks yet.
    pub(crate) fn new(packet_nanos: i64, block_nanos: i64) -> Self {
        Self { packet_nanos, block_nanos, ..Self::default() }
    }

    /// Adds a block; blocks beyond [`MAX_BLOCKS`] are ignored. `turned`: encoder counts since the start of the
    /// revolution, 0 to 35999; `None` if the block cannot be decoded.
    pub(crate) fn push(&mut self, nanos: i32, turned: Option<u16>) {
        self.add(nanos, turned.unwrap_or(INVALID));
    }

    /// Adds a block in which the sensor sent nothing.
    pub(crate) fn push_empty(&mut self) {
        self.add(0, EMPTY);
    }

    fn add(&mut self, nanos: i32, turned: u16) {
        if let (Some(to_nanos), Some(to_turned)) = (self.nanos.get_mut(self.len), self.turned.get_mut(self.len)) {
            *to_nanos = nanos;
            *to_turned = turned;
            self.len += 1;
        }
    }

    /// Number of blocks.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// First firing of a block, ns after the time of the packet, and encoder counts since the start of the revolution.
    pub(crate) fn get(&self, index: usize) -> Option<(i64, u16)> {
        let nanos = *self.nanos[..self.len].get(index)?;
        let turned = self.turned[index];
        (turned < EMPTY).then_some((i64::from(nanos), turned))
    }

    /// Blocks that cannot be decoded.
    pub(crate) fn n_bad(&self) -> usize {
        self.turned[..self.len].iter().filter(|turned| **turned == INVALID).count()
    }
}
