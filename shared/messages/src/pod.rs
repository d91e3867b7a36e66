//! Types whose bytes may be shared between processes.

use crate::ByteField;

/// A plain-data type: `repr(C)`, no padding, no pointers, every bit pattern valid. `bytemuck` proves it at compile time.
/// The `pod!` macro of this crate adds the fields.
pub trait Pod: bytemuck::Pod + Send + Sync {
    /// Fingerprint of the field names and types in order. Two processes that differ in it must not exchange messages.
    const LAYOUT: u64;

    /// Appends the fields of a value called `name` that starts at byte `offset` to `fields`. A number is one field, and
    /// so is an array of numbers; the fields of a struct are listed one by one.
    fn describe(name: &str, offset: usize, fields: &mut Vec<ByteField>);

    /// Whether all floating-point numbers are finite.
    fn is_finite(&self) -> bool;
}

/// FNV-1a over `bytes`, continued from `state`.
pub const fn fingerprint(mut state: u64, bytes: &[u8]) -> u64 {
    let mut i = 0;
    while i < bytes.len() {
        state = (state ^ bytes[i] as u64).wrapping_mul(0x0100_0000_01b3);
        i += 1;
    }
    state
}

/// Initial state of a fingerprint: the FNV-1a offset basis.
pub const FINGERPRINT_START: u64 = 0xcbf2_9ce4_8422_2325;

macro_rules! pod_number {
    ($is_finite:expr; $($t:ty),*) => {$(
        impl Pod for $t {
            const LAYOUT: u64 = fingerprint(FINGERPRINT_START, stringify!($t).as_bytes());
            fn describe(name: &str, offset: usize, fields: &mut Vec<ByteField>) {
                fields.push(ByteField { name: name.to_owned(), offset, kind: stringify!($t).to_owned(), count: 1 });
            }
            fn is_finite(&self) -> bool {
                let is_finite: fn($t) -> bool = $is_finite;
                is_finite(*self)
            }
        }
    )*};
}
pod_number!(|_| true; u8, u16, u32, u64, i8, i16, i32, i64);
pod_number!(|value| value.is_finite(); f32, f64);

impl<T: Pod, const N: usize> Pod for [T; N]
where
    [T; N]: bytemuck::Pod,
{
    const LAYOUT: u64 = fingerprint(T::LAYOUT, &(N as u64).to_le_bytes());
    fn describe(name: &str, offset: usize, fields: &mut Vec<ByteField>) {
        let mut first = Vec::new();
        T::describe(name, offset, &mut first);
        match first.as_mut_slice() {
            [number] if number.name == name => {
                number.count *= N;
                fields.append(&mut first);
            }
            _ => (0..N).for_each(|i| T::describe(&format!("{name}.{i}"), offset + i * size_of::<T>(), fields)),
        }
    }
    fn is_finite(&self) -> bool {
        self.iter().all(Pod::is_finite)
    }
}

/// Declares a `repr(C)` struct that is [`Pod`]. The derive fails to compile if a field is not [`Pod`] or if there is
/// padding.
macro_rules! pod {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$field_meta:meta])* pub $field:ident: $kind:ty),* $(,)? }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind),* }

        impl $crate::Pod for $name {
            const LAYOUT: u64 = {
                let state = $crate::pod::FINGERPRINT_START;
                $(
                    let state = $crate::pod::fingerprint(state, stringify!($field).as_bytes());
                    let state = $crate::pod::fingerprint(state, &<$kind as $crate::Pod>::LAYOUT.to_le_bytes());
                )*
                state
            };
            #[allow(unused_assignments, reason = "no field follows the last one")]
            fn describe(name: &str, mut offset: usize, fields: &mut Vec<$crate::ByteField>) {
                let prefix = if name.is_empty() { String::new() } else { format!("{name}.") };
                $(
                    <$kind as $crate::Pod>::describe(&format!("{prefix}{}", stringify!($field)), offset, fields);
                    // There is no padding: the next field follows immediately.
                    offset += size_of::<$kind>();
                )*
            }
            fn is_finite(&self) -> bool {
                $(<$kind as $crate::Pod>::is_finite(&self.$field))&&*
            }
        }

        impl Default for $name {
            fn default() -> Self {
                bytemuck::Zeroable::zeroed()
            }
        }
    };
}

pub(crate) use pod;

/// The bytes of `rows`, in place.
pub fn bytes_from_rows<T: Pod>(rows: &[T]) -> &[u8] {
    bytemuck::cast_slice(rows)
}

/// The bytes of `rows`, in place, for writing.
pub fn bytes_from_rows_mut<T: Pod>(rows: &mut [T]) -> &mut [u8] {
    bytemuck::cast_slice_mut(rows)
}

/// `n` rows whose bytes are all zero. The operating system provides memory of this size as zeros, so rows that are never
/// written cost nothing.
pub fn zeroed_rows<T: Pod>(n: usize) -> Vec<T> {
    bytemuck::zeroed_vec(n)
}

/// Copies `bytes` into rows. `None` if the length is not a multiple of the row's size.
pub fn rows_from_bytes<T: Pod>(bytes: &[u8]) -> Option<Vec<T>> {
    if size_of::<T>() == 0 || !bytes.len().is_multiple_of(size_of::<T>()) {
        return None;
    }
    let mut rows = zeroed_rows::<T>(bytes.len() / size_of::<T>());
    bytes_from_rows_mut(&mut rows).copy_from_slice(bytes);
    Some(rows)
}

/// Reads `bytes` in place as rows. `None` if the length is not a multiple of the row's size, or the bytes are not aligned
/// for it.
pub fn rows_in_bytes<T: Pod>(bytes: &[u8]) -> Option<&[T]> {
    bytemuck::try_cast_slice(bytes).ok()
}

/// Reads rows in place as another type of the same size and alignment, e.g. `u32` words as `f32`.
pub fn cast_slice<T: Pod, U: Pod>(rows: &[T]) -> &[U] {
    const { assert!(size_of::<T>() == size_of::<U>() && align_of::<T>() == align_of::<U>()) };
    bytemuck::cast_slice(rows)
}

/// [`cast_slice`] for writing.
pub fn cast_slice_mut<T: Pod, U: Pod>(rows: &mut [T]) -> &mut [U] {
    const { assert!(size_of::<T>() == size_of::<U>() && align_of::<T>() == align_of::<U>()) };
    bytemuck::cast_slice_mut(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    pod! {
        /// Two fields.
        pub struct Pair { /// First.
            pub a: u32, /// Second.
            pub b: f32 }
    }
    pod! {
        /// The layout of [`Pair`] with the names of its fields swapped.
        pub struct Swapped { /// First.
            pub b: u32, /// Second.
            pub a: f32 }
    }

    #[test]
    fn rows_through_bytes_are_unchanged() {
        let rows = [Pair { a: 7, b: 0.5 }, Pair { a: u32::MAX, b: -1.0 }];
        let bytes = bytes_from_rows(&rows);
        assert_eq!(bytes.len(), 16);
        assert_eq!(rows_from_bytes::<Pair>(bytes).as_deref(), Some(&rows[..]));
        assert_eq!(rows_from_bytes::<Pair>(&bytes[..15]), None);
    }

    #[test]
    fn zeroed_rows_can_be_written_as_bytes() {
        assert_eq!(zeroed_rows::<Pair>(0), []);
        let mut rows = zeroed_rows::<Pair>(3);
        assert_eq!(rows, [Pair::default(); 3]);
        let source = [Pair { a: 1, b: 2.0 }, Pair { a: 3, b: 4.0 }, Pair { a: 5, b: 6.0 }];
        bytes_from_rows_mut(&mut rows).copy_from_slice(bytes_from_rows(&source));
        assert_eq!(rows, source);
    }

    #[test]
    fn words_cast_to_floats_keep_their_bits() {
        let mut words = [1.5_f32.to_bits(), (-2.0_f32).to_bits()];
        cast_slice_mut::<u32, f32>(&mut words)[0] = 4.0;
        assert_eq!(cast_slice::<u32, f32>(&words), [4.0, -2.0]);
    }

    #[test]
    fn layout_of_renamed_field_differs() {
        assert_ne!(Pair::LAYOUT, Swapped::LAYOUT);
        assert_ne!(<[f32; 3]>::LAYOUT, <[f32; 4]>::LAYOUT);
    }
}
