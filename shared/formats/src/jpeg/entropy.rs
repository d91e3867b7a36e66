//! Checks that the image data of a JPEG file is undamaged: each block is decoded up to its coefficients. Decoders
//! continue after damage: the rest of the image is shifted, discolored or gray.

use super::bits::Bits;
use super::huffman::Huffman;
use super::{ALONE, END_OF_IMAGE, JpegError, START_OF_SCAN, next_marker};

/// Frames whose blocks are coded one after the other with Huffman codes. Other frames, such as progressive ones, are not
/// checked.
const SEQUENTIAL: [u8; 2] = [0xc0, 0xc1];
const HUFFMAN_TABLES: u8 = 0xc4;
const QUANTIZATION_TABLES: u8 = 0xdb;
const RESTART_INTERVAL: u8 = 0xdd;
const FIRST_RESTART: u8 = 0xd0;
/// Largest mean of a block of samples of 8 bits, in units of the coefficient; encoders round up to one step beyond it.
const MAX_MEAN: i32 = 1024;

/// A component of the image, as the header of the frame gives it.
#[derive(Clone, Copy, Default)]
struct Component {
    id: u8,
    horizontal: u32,
    vertical: u32,
    quantization: usize,
}

/// Content of the segments before a scan.
#[derive(Default)]
struct Header {
    size: [u32; 2],
    components: Vec<Component>,
    /// Huffman tables 0 to 3 of the means, then tables 0 to 3 of the other coefficients.
    huffman: [Option<Huffman>; 8],
    /// The first value of each quantization table, which applies to the mean.
    mean_steps: [i32; 4],
    restart_interval: u64,
}

/// Checks the scans of a sequential JPEG file of 8 bits. Files whose headers are of another kind or invalid are left to the decoder.
pub(super) fn check(bytes: &[u8]) -> Result<(), JpegError> {
    let mut header = Header::default();
    let mut at = 2;
    while let Some((marker, after)) = next_marker(bytes, at) {
        if ALONE.contains(&marker) {
            at = after;
            continue;
        }
        let Some(segment) = (marker != END_OF_IMAGE).then(|| segment(bytes, after)).flatten() else { return Ok(()) };
        at = after + 2 + segment.len();
        match marker {
            START_OF_SCAN => match Scan::new(&header, segment) {
                Some(scan) => at = scan.check(bytes, at)?,
                None => return Ok(()),
            },
            _ if header.read(marker, segment).is_none() => return Ok(()),
            _ => {}
        }
    }
    Ok(())
}

/// The content of a segment after its length.
fn segment(bytes: &[u8], at: usize) -> Option<&[u8]> {
    let length = u16::from_be_bytes(*bytes.get(at..)?.first_chunk()?);
    bytes.get(at + 2..at + usize::from(length))
}

impl Header {
    /// Reads a segment. `None` if it is invalid or of another kind of JPEG.
    fn read(&mut self, marker: u8, segment: &[u8]) -> Option<()> {
        match marker {
            _ if SEQUENTIAL.contains(&marker) => self.read_frame(segment),
            HUFFMAN_TABLES => self.read_huffman(segment),
            QUANTIZATION_TABLES => self.read_quantization(segment),
            RESTART_INTERVAL => {
                self.restart_interval = u64::from(u16::from_be_bytes(*segment.first_chunk()?));
                Some(())
            }
            // Other frames: progressive, lossless, arithmetic.
            0xc2..=0xcf => None,
            _ => Some(()),
        }
    }

    fn read_frame(&mut self, segment: &[u8]) -> Option<()> {
        let [bits, y0, y1, x0, x1, n] = *segment.first_chunk()?;
        self.size = [u32::from(u16::from_be_bytes([x0, x1])), u32::from(u16::from_be_bytes([y0, y1]))];
        let components = segment[6..].chunks_exact(3).take(usize::from(n));
        self.components = components
            .map(|c| Component {
                id: c[0],
                horizontal: u32::from(c[1] >> 4),
                vertical: u32::from(c[1] & 15),
                quantization: usize::from(c[2] & 3),
            })
            .collect();
        let is_valid = |c: &Component| (1..=4).contains(&c.horizontal) && (1..=4).contains(&c.vertical);
        (bits == 8 && !self.size.contains(&0) && self.components.iter().all(is_valid)).then_some(())
    }

    fn read_huffman(&mut self, mut segment: &[u8]) -> Option<()> {
        while let Some((kind, rest)) = segment.split_first() {
            let (counts, rest) = rest.split_first_chunk::<16>()?;
            let n: usize = counts.iter().map(|count| usize::from(*count)).sum();
            let (symbols, rest) = rest.split_at_checked(n)?;
            let index = usize::from(kind >> 4) * 4 + usize::from(kind & 15);
            *self.huffman.get_mut(index)? = Some(Huffman::new(counts, symbols)?);
            segment = rest;
        }
        Some(())
    }

    fn read_quantization(&mut self, mut segment: &[u8]) -> Option<()> {
        while let Some((kind, rest)) = segment.split_first() {
            let is_wide = kind >> 4 > 0;
            let (values, rest) = rest.split_at_checked(if is_wide { 128 } else { 64 })?;
            let first = if is_wide { u16::from_be_bytes([values[0], values[1]]) } else { u16::from(values[0]) };
            *self.mean_steps.get_mut(usize::from(kind & 15))? = i32::from(first);
            segment = rest;
        }
        Some(())
    }
}

/// Role of a block in the scan: the component whose mean it continues, and the tables of its codes.
struct Coded<'a> {
    component: usize,
    mean: &'a Huffman,
    others: &'a Huffman,
    step: i32,
}

/// A scan.
struct Scan<'a> {
    /// The blocks of one minimum coded unit.
    blocks: Vec<Coded<'a>>,
    n_units: u64,
    restart_interval: u64,
}

impl<'a> Scan<'a> {
    /// Parses the header of a scan. `None` if the header lacks an entry or the scan is not sequential.
    fn new(header: &'a Header, segment: &[u8]) -> Option<Self> {
        let (n, rest) = segment.split_first()?;
        let n = usize::from(*n);
        // The spectral selection of a sequential scan covers all coefficients.
        if !(1..=4).contains(&n) || rest.len() < 2 * n + 3 || rest[2 * n..2 * n + 3] != [0, 63, 0] {
            return None;
        }
        let max = |side: fn(&Component) -> u32| header.components.iter().map(side).max().unwrap_or(1);
        let horizontal = max(|c| c.horizontal);
        let vertical = max(|c| c.vertical);
        let mut blocks = Vec::new();
        let mut alone = None;
        for (index, chosen) in rest[..2 * n].chunks_exact(2).enumerate() {
            let component = *header.components.iter().find(|component| component.id == chosen[0])?;
            let table = |kind: usize, number: u8| header.huffman.get(kind * 4 + usize::from(number & 3))?.as_ref();
            let mean = table(0, chosen[1] >> 4)?;
            let others = table(1, chosen[1])?;
            let step = header.mean_steps[component.quantization];
            // A scan of a single component is coded block by block.
            let n_blocks = if n == 1 { 1 } else { component.horizontal * component.vertical };
            blocks.extend((0..n_blocks).map(|_| Coded { component: index, mean, others, step }));
            alone = Some(component);
        }
        let [width, height] = header.size;
        let units = |size: u32, own: u32, most: u32| match n {
            1 => u64::from((size * own).div_ceil(most).div_ceil(8)),
            _ => u64::from(size.div_ceil(8 * most)),
        };
        let alone = alone?;
        let n_units = units(width, alone.horizontal, horizontal) * units(height, alone.vertical, vertical);
        Some(Self { blocks, n_units, restart_interval: header.restart_interval })
    }

    /// Checks the data that begins at `at`. Returns the offset of its end.
    fn check(&self, bytes: &[u8], mut at: usize) -> Result<usize, JpegError> {
        let n_blocks = self.n_units * self.blocks.len() as u64;
        let interval = if self.restart_interval == 0 { self.n_units } else { self.restart_interval };
        let mut unit = 0;
        while unit < self.n_units {
            let end = (unit + interval).min(self.n_units);
            let mut bits = Bits::new(bytes, at);
            let mut means = [0; 4];
            for unit in unit..end {
                for (index, coded) in self.blocks.iter().enumerate() {
                    let block = unit * self.blocks.len() as u64 + index as u64 + 1;
                    let is_coded = coded.skip_block(&mut bits, means.get_mut(coded.component));
                    let at = bits.at();
                    if bits.is_behind_end() {
                        return Err(JpegError::Short { at, block, n_blocks });
                    }
                    if is_coded.is_none() {
                        return Err(JpegError::Code { at, block, n_blocks });
                    }
                    if means.get(coded.component).is_some_and(|mean| (mean * coded.step).abs() > MAX_MEAN + coded.step)
                    {
                        return Err(JpegError::Brightness { at, block, n_blocks });
                    }
                }
            }
            let n_bytes = bits.skip_rest();
            at = bits.at();
            if n_bytes > 0 {
                return Err(JpegError::Long { at, n_bytes, n_blocks });
            }
            if end < self.n_units {
                let number = ((end / interval - 1) % 8) as u8;
                match next_marker(bytes, at) {
                    Some((marker, after)) if marker == FIRST_RESTART + number => at = after,
                    _ => return Err(JpegError::Restart { at, number }),
                }
            }
            unit = end;
        }
        Ok(at)
    }
}

impl Coded<'_> {
    /// Skips a block and adds its difference to the mean of its component. `None` if it is not validly coded.
    fn skip_block(&self, bits: &mut Bits<'_>, mean: Option<&mut i32>) -> Option<()> {
        let n_bits = u32::from(self.mean.next(bits)?);
        if n_bits > 11 {
            return None;
        }
        let value = (bits.peek() >> (16 - n_bits)) as i32;
        bits.skip(n_bits);
        // Values without the highest bit are negative.
        let is_negative = n_bits > 0 && value >> (n_bits - 1) == 0;
        *mean? += if is_negative { value + 1 - (1 << n_bits) } else { value };
        let mut index = 1;
        while index < 64 {
            let symbol = self.others.next(bits)?;
            let run = u32::from(symbol >> 4);
            let n_bits = u32::from(symbol & 15);
            match (run, n_bits) {
                (0, 0) => return Some(()),
                (15, 0) => index += 16,
                (_, 1..=10) => {
                    index += run + 1;
                    bits.skip(n_bits);
                }
                _ => return None,
            }
        }
        (index == 64).then_some(())
    }
}
