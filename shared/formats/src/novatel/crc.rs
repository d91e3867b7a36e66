//! The checksum of the messages: CRC-32 with the reversed polynomial, initial value 0, without final inversion.

/// The checksum of some bytes.
pub fn crc32(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 })
    })
}
