//! Sorting pixels by value.

use crate::level::Level;
use crate::padded::Padded;

/// All pixels except the frame, sorted by `key` of their ranks, equal ranks in raster order. Entries have the key in the upper half and
/// the flat index in the lower. Radix sort.
pub(crate) fn sorted_by<T: Level>(levels: &Padded<T>, key: impl Fn(u32) -> u32) -> Vec<u64> {
    const BITS: u32 = 11;
    let digit = |entry: u64, shift: u32| (entry >> (32 + shift)) as usize & ((1 << BITS) - 1);
    let row = |row: usize| levels.row_start(row)..levels.row_start(row) + levels.cols;
    let entry = |pixel: usize| u64::from(key(levels.pixels[pixel].rank())) << 32 | pixel as u64;
    let mut entries: Vec<u64> = Vec::with_capacity(levels.rows * levels.cols);
    for pixels in (0..levels.rows).map(row) {
        entries.extend(pixels.map(entry));
    }
    let mut sorted = Vec::new();
    for shift in (0..u32::BITS).step_by(BITS as usize) {
        let mut ends = vec![0_usize; 1 << BITS];
        for &entry in &entries {
            ends[digit(entry, shift)] += 1;
        }
        if ends.contains(&entries.len()) {
            continue;
        }
        let mut start = 0;
        for end in &mut ends {
            (start, *end) = (start + *end, start);
        }
        sorted.resize(entries.len(), 0);
        for &entry in &entries {
            let place = &mut ends[digit(entry, shift)];
            sorted[*place] = entry;
            *place += 1;
        }
        std::mem::swap(&mut entries, &mut sorted);
    }
    entries
}
