//! The layout of a message in shared memory.
//!
//! A slot is a run of cache lines: first the header, padded to whole lines, then the rows.
//!
//! | line | content |
//! |---|---|
//! | 0 .. `header_lines` | `T::Header`, rest zero |
//! | `header_lines` .. | rows of `T::Row`, without gaps |

#![allow(unsafe_code, reason = "declares to iceoryx2 which types may be shared; each block states why")]

use crate::Iox;
use crate::opaque::Opaque;
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use messages::{Envelope, Message};
use std::marker::PhantomData;
use std::mem::MaybeUninit;

/// 64 bytes, so that headers and rows start on a cache line whatever their type.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub(crate) struct CacheLine([u8; LINE]);

/// Bytes of a [`CacheLine`].
pub(crate) const LINE: usize = 64;

impl std::fmt::Debug for CacheLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("CacheLine")
    }
}

// SAFETY: plain bytes with a fixed layout: self-contained, no pointers, the same in every process.
unsafe impl ZeroCopySend for CacheLine {
    unsafe fn type_name() -> &'static str {
        "replica.CacheLine.v1"
    }
}

/// The envelope as iceoryx2's user header.
#[derive(Clone, Copy, Debug, Default)]
#[repr(transparent)]
pub(crate) struct WireEnvelope(pub(crate) Envelope);

// SAFETY: transparent over a `Pod`: `repr(C)`, self-contained, no pointers.
unsafe impl ZeroCopySend for WireEnvelope {
    unsafe fn type_name() -> &'static str {
        "replica.Envelope.v1"
    }
}

/// Number of lines of the header.
pub(crate) const fn header_lines<T: Message>() -> usize {
    const { assert!(align_of::<T::Header>() <= LINE && align_of::<T::Row>() <= LINE) };
    const { assert!(size_of::<T::Header>() > 0 && size_of::<T::Row>() > 0) };
    const { assert!(T::MAX_ROWS <= u32::MAX as usize, "the envelope counts rows in 32 bits") };
    size_of::<T::Header>().div_ceil(LINE)
}

/// The bytes of a slot.
pub(crate) fn bytes_of_lines(lines: &[CacheLine]) -> &[u8] {
    bytemuck::cast_slice(lines)
}

/// The header and `len` rows of a slot; `None` if it is too short for them.
pub(crate) fn view<T: Message>(lines: &[CacheLine], len: usize) -> Option<(&T::Header, &[T::Row])> {
    let (header, rows) = lines.split_at_checked(header_lines::<T>())?;
    let header = bytemuck::from_bytes(bytes_of_lines(header).get(..size_of::<T::Header>())?);
    let rows = bytes_of_lines(rows).get(..len.checked_mul(size_of::<T::Row>())?)?;
    Some((header, bytemuck::cast_slice(rows)))
}

/// The header and the rows `range` of a slot, for writing.
fn view_mut<T: Message>(
    lines: &mut [CacheLine],
    range: std::ops::Range<usize>,
) -> Option<(&mut T::Header, &mut [T::Row])> {
    let (header, rows) = lines.split_at_mut_checked(header_lines::<T>())?;
    let header = bytemuck::from_bytes_mut(bytemuck::cast_slice_mut(header).get_mut(..size_of::<T::Header>())?);
    let bytes = range.start * size_of::<T::Row>()..range.end * size_of::<T::Row>();
    let rows: &mut [u8] = bytemuck::cast_slice_mut::<_, u8>(rows).get_mut(bytes)?;
    Some((header, bytemuck::cast_slice_mut(rows)))
}

/// Reason why a loan always has its header and rows.
const LONG_ENOUGH: &str = "the slot was loaned with enough lines";

/// Memory of a message under construction.
pub(crate) trait SlotMemory {
    /// All lines.
    fn lines(&self) -> &[CacheLine];
    /// All lines, for writing.
    fn lines_mut(&mut self) -> &mut [CacheLine];
}

/// A slot that its producer writes.
pub(crate) struct Slot(Opaque<SampleMut<Iox, [CacheLine], WireEnvelope>>);

impl Slot {
    pub(crate) fn new(sample: SampleMutUninit<Iox, [MaybeUninit<CacheLine>], WireEnvelope>) -> Self {
        // SAFETY: the slot lies in mapped shared memory, whose bytes the operating system has initialised (zero, or the
        // bytes of an earlier message), and any bytes are a valid `CacheLine`.
        Self(Opaque::new(unsafe { sample.assume_init() }))
    }
    fn fill(mut self, envelope: Envelope) -> FilledSlot {
        *self.0.user_header_mut() = WireEnvelope(envelope);
        FilledSlot(self)
    }
}

impl SlotMemory for Slot {
    fn lines(&self) -> &[CacheLine] {
        self.0.payload()
    }
    fn lines_mut(&mut self) -> &mut [CacheLine] {
        self.0.payload_mut()
    }
}

/// A slot with a complete message.
pub(crate) struct FilledSlot(Slot);

impl FilledSlot {
    pub(crate) fn into_sample(self) -> SampleMut<Iox, [CacheLine], WireEnvelope> {
        self.0.0.into_inner()
    }
}

/// A slot that a consumer reads.
pub(crate) struct ReceivedSlot(Opaque<Sample<Iox, [CacheLine], WireEnvelope>>);

impl ReceivedSlot {
    pub(crate) fn new(sample: Sample<Iox, [CacheLine], WireEnvelope>) -> Self {
        Self(Opaque::new(sample))
    }
    pub(crate) fn envelope(&self) -> &Envelope {
        self.content().0
    }
    pub(crate) fn lines(&self) -> &[CacheLine] {
        self.content().1
    }
    pub(crate) fn content(&self) -> (&Envelope, &[CacheLine]) {
        let sample = &*self.0;
        (&sample.user_header().0, sample.payload())
    }
}

/// A message under construction, in the shared memory in which its consumers will read it.
pub(crate) struct SharedLoan<T: Message, S = Slot> {
    slot: S,
    len: usize,
    capacity: usize,
    message: PhantomData<T>,
}

impl<T: Message, S: SlotMemory> SharedLoan<T, S> {
    /// A loan of `slot`, which holds `capacity` rows.
    pub(crate) fn new(slot: S, capacity: usize) -> Self {
        let mut loan = Self { slot, len: 0, capacity, message: PhantomData };
        *loan.header_mut() = T::Header::default();
        loan
    }
    pub(crate) fn capacity(&self) -> usize {
        self.capacity
    }
    pub(crate) fn rows(&self) -> &[T::Row] {
        view::<T>(self.slot.lines(), self.len).expect(LONG_ENOUGH).1
    }
    pub(crate) fn rows_mut(&mut self) -> &mut [T::Row] {
        view_mut::<T>(self.slot.lines_mut(), 0..self.len).expect(LONG_ENOUGH).1
    }
    pub(crate) fn header_mut(&mut self) -> &mut T::Header {
        view_mut::<T>(self.slot.lines_mut(), 0..0).expect(LONG_ENOUGH).0
    }
    /// Appends `n` rows with the bytes of an earlier message. `None` if they do not fit.
    pub(crate) fn append(&mut self, n: usize) -> Option<&mut [T::Row]> {
        if n > self.capacity - self.len {
            return None;
        }
        let start = self.len;
        self.len += n;
        let (_, rows) = view_mut::<T>(self.slot.lines_mut(), start..self.len).expect(LONG_ENOUGH);
        Some(rows)
    }
}

impl<T: Message> SharedLoan<T> {
    pub(crate) fn finish(self, mut envelope: Envelope) -> FilledSlot {
        envelope.len = self.len as u32;
        self.slot.fill(envelope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message_type::MessageType;
    use messages::{SubmapHeader, SubmapTopic, SweepPoint, SweepTopic, TickTopic};

    /// Writes rows into a slot of `n_lines` lines and reads them back.
    fn round_trip<T: Message>(n_rows: usize) {
        let message = MessageType::of::<T>();
        let mut lines = vec![CacheLine([0xa5; LINE]); message.lines_for(n_rows)];
        let (header, rows) = view_mut::<T>(&mut lines, 0..n_rows).expect("fits");
        *header = T::Header::default();
        rows.fill(bytemuck::Zeroable::zeroed());
        let (header, rows) = view::<T>(&lines, n_rows).expect("fits");
        assert!(bytemuck::bytes_of(header).iter().chain(bytemuck::cast_slice(rows)).all(|byte| *byte == 0));
        let bytes = size_of_val(&lines[header_lines::<T>()..]);
        let fitting = bytes / size_of::<T::Row>();
        for n_rows in [0, fitting, fitting + 1, usize::MAX] {
            assert_eq!(view::<T>(&lines, n_rows).is_some(), n_rows <= fitting);
            assert_eq!(message.fits(lines.len(), n_rows), n_rows <= fitting);
        }
    }

    #[test]
    fn slot_returns_written_header_and_rows() {
        for n_rows in [0, 1, 3, 64, 100] {
            round_trip::<SweepTopic>(n_rows);
            round_trip::<SubmapTopic>(n_rows);
            round_trip::<TickTopic>(n_rows);
        }
        assert_eq!(header_lines::<SubmapTopic>(), size_of::<SubmapHeader>().div_ceil(64));
        assert!(view::<SubmapTopic>(&[], 0).is_none());
        assert!(!MessageType::of::<SubmapTopic>().fits(0, 0));
    }

    /// Memory as the operating system provides it: zero, and never written by this program.
    struct HeapSlot(Box<[CacheLine]>);

    impl HeapSlot {
        fn new(n_lines: usize) -> Self {
            let lines = vec![MaybeUninit::<CacheLine>::zeroed(); n_lines].into_boxed_slice();
            // SAFETY: as in `Slot::new`: the bytes are zero, and any bytes are a valid `CacheLine`.
            Self(unsafe { lines.assume_init() })
        }
    }

    impl SlotMemory for HeapSlot {
        fn lines(&self) -> &[CacheLine] {
            &self.0
        }
        fn lines_mut(&mut self) -> &mut [CacheLine] {
            &mut self.0
        }
    }

    /// `cargo miri test -p ipc --lib slot::` runs this file without shared memory: alignment, bounds and aliasing of a loan.
    #[test]
    fn loan_is_written_in_place_and_read_back() {
        let message = MessageType::of::<SweepTopic>();
        let mut slot = HeapSlot::new(message.lines_for(5));
        // The second message is in the slot of the first one.
        for seq in 1..=2 {
            let mut loan = SharedLoan::<SweepTopic, _>::new(slot, 5);
            for index in 0..3 {
                let rows = loan.append(1).expect("room for a row");
                rows[0] = SweepPoint { offset_nanos: 10 * seq + index, ..SweepPoint::default() };
            }
            assert!(loan.append(3).is_none(), "room for two rows is left");
            loan.rows_mut()[1].offset_nanos += 5;
            loan.header_mut().n_rings = 32;
            assert_eq!((loan.rows().len(), loan.capacity()), (3, 5));
            slot = loan.slot;
            let (header, rows) = view::<SweepTopic>(slot.lines(), 3).expect("fits");
            let offsets: Vec<u32> = rows.iter().map(|row| row.offset_nanos).collect();
            assert_eq!((header.n_rings, offsets), (32, vec![10 * seq, 10 * seq + 6, 10 * seq + 2]));
            assert_eq!(rows.as_ptr().addr() % LINE, 0, "rows start on a cache line");
        }
    }
}
