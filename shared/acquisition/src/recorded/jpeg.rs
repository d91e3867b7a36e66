//! Whether a JPEG file is complete. Decoders fill the missing part of a cut image with gray.

/// Markers without a segment: `TEM` and `RST0` to `RST7`.
const ALONE: [u8; 9] = [0x01, 0xd0, 0xd1, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7];
const START_OF_SCAN: u8 = 0xda;
const END_OF_IMAGE: u8 = 0xd9;

/// Whether the bytes begin like a JPEG file.
pub(crate) fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xff, 0xd8])
}

/// Whether the image data of a JPEG file ends with the marker "end of image". Bytes behind it are ignored. Segments are skipped by
/// their lengths, so the end of an embedded thumbnail does not count.
pub(crate) fn is_complete(bytes: &[u8]) -> bool {
    let mut at = 2;
    let mut has_scan = false;
    while let Some((marker, after)) = next_marker(bytes, at) {
        match marker {
            END_OF_IMAGE => return has_scan,
            marker if ALONE.contains(&marker) => at = after,
            marker => {
                has_scan |= marker == START_OF_SCAN;
                // The entropy-coded data behind the header of a scan has no markers but restarts.
                let Some(length) = bytes.get(after..).and_then(<[u8]>::first_chunk) else { return false };
                at = after + usize::from(u16::from_be_bytes(*length));
            }
        }
    }
    false
}

/// The next marker and the offset behind it. `ff 00` is a stuffed byte of entropy-coded data, and `ff ff` is padding.
fn next_marker(bytes: &[u8], from: usize) -> Option<(u8, usize)> {
    let pairs = bytes.get(from..)?.windows(2).enumerate();
    let mut markers = pairs.filter(|(_, pair)| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xff));
    markers.next().map(|(offset, pair)| (pair[1], from + offset + 2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::jpeg::JpegEncoder;

    #[test]
    fn jpeg_cut_anywhere_is_incomplete() {
        let image = image::RgbImage::from_fn(64, 48, |x, y| image::Rgb([(x * 37 % 251) as u8, (y * 11) as u8, 7]));
        let mut whole = Vec::new();
        JpegEncoder::new_with_quality(&mut whole, 80).encode_image(&image).expect("encodes");
        assert!(is_jpeg(&whole) && is_complete(&whole));
        for length in 0..whole.len() {
            assert!(!is_complete(&whole[..length]), "{length} of {} bytes", whole.len());
        }
        // As file systems leave the rest of a file after a power loss.
        let mut zeros = whole.clone();
        zeros[whole.len() / 2..].fill(0);
        assert!(!is_complete(&zeros));
        // A thumbnail with its own end, in a segment.
        let thumbnail = [&[0xff, 0xe1, 0, 10][..], &[0xff, 0xd8, 0xff, 0xda, 0, 2, 0xff, 0xd9]].concat();
        let cut = [&whole[..2], &thumbnail, &whole[2..whole.len() / 2]].concat();
        assert!(!is_complete(&cut) && is_complete(&[&whole[..2], &thumbnail, &whole[2..], b"extra"].concat()));
    }
}
