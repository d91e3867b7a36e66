//! Layout of data packets.

/// Number of beams of all models.
const BEAMS: [usize; 4] = [16, 32, 64, 128];
/// Columns of a packet, unless the sensor was configured otherwise.
const COLUMNS: usize = 16;
/// Bytes of an IMU packet.
const IMU_BYTES: usize = 48;

/// Format of the pixels of data packets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// Firmware before 2.2, and later by choice.
    Legacy,
    /// `RNG15_RFL8_NIR8`: low data rate.
    LowData,
    /// `RNG19_RFL8_SIG16_NIR16`: single return.
    Single,
    /// `RNG19_RFL8_SIG16_NIR16_DUAL`: two echoes.
    Dual,
}

/// An echo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Echo {
    /// Range, mm; 0 = no echo.
    pub(super) range_mm: u32,
    /// Reflectivity; early firmware has more than 255.
    pub(super) reflectivity: u16,
}

/// Bytes of a column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column<'a> {
    bytes: &'a [u8],
    profile: Profile,
}

impl Profile {
    /// All supported profiles.
    pub const ALL: [Profile; 4] = [Profile::Legacy, Profile::LowData, Profile::Single, Profile::Dual];

    /// Name in the metadata.
    pub const fn name(self) -> &'static str {
        match self {
            Profile::Legacy => "LEGACY",
            Profile::LowData => "RNG15_RFL8_NIR8",
            Profile::Single => "RNG19_RFL8_SIG16_NIR16",
            Profile::Dual => "RNG19_RFL8_SIG16_NIR16_DUAL",
        }
    }

    pub(super) const fn pixel_bytes(self) -> usize {
        match self {
            Profile::Legacy | Profile::Single => 12,
            Profile::LowData => 4,
            Profile::Dual => 16,
        }
    }

    /// Bytes before and after the columns.
    pub(super) const fn frame_bytes(self) -> usize {
        if let Profile::Legacy = self { 0 } else { 32 }
    }

    const fn column_header_bytes(self) -> usize {
        if let Profile::Legacy = self { 16 } else { 12 }
    }

    const fn column_footer_bytes(self) -> usize {
        if let Profile::Legacy = self { 4 } else { 0 }
    }

    pub(super) const fn column_bytes(self, n_beams: usize) -> usize {
        self.column_header_bytes() + n_beams * self.pixel_bytes() + self.column_footer_bytes()
    }

    pub(super) const fn packet_bytes(self, n_columns: usize, n_beams: usize) -> usize {
        2 * self.frame_bytes() + n_columns * self.column_bytes(n_beams)
    }

    /// The first and, if the profile has it, the second echo of a pixel.
    #[inline(always)]
    pub(super) fn echoes(self, pixel: &[u8]) -> [Echo; 2] {
        let word =
            |at: usize| pixel.get(at..).and_then(|rest| rest.first_chunk()).map_or(0, |b| u32::from_le_bytes(*b));
        let byte = |at: usize| pixel.get(at).copied().map_or(0, u16::from);
        let echo = |range_mm, reflectivity| Echo { range_mm, reflectivity };
        match self {
            Profile::Legacy => [echo(word(0) & 0xf_ffff, byte(4) | byte(5) << 8), Echo::default()],
            Profile::LowData => [echo((word(0) & 0x7fff) * 8, byte(2)), Echo::default()],
            Profile::Single => [echo(word(0) & 0x7_ffff, byte(4)), Echo::default()],
            Profile::Dual => [echo(word(0) & 0x7_ffff, byte(3)), echo(word(4) & 0x7_ffff, byte(7))],
        }
    }
}

impl<'a> Column<'a> {
    /// A column of a packet of [`Profile::packet_bytes`].
    pub(super) fn from_payload(payload: &'a [u8], profile: Profile, n_beams: usize, index: usize) -> Option<Self> {
        let n_bytes = profile.column_bytes(n_beams);
        let bytes = payload.get(profile.frame_bytes() + index * n_bytes..)?.get(..n_bytes)?;
        Some(Self { bytes, profile })
    }

    /// Time, ns.
    pub(super) fn nanos(self) -> u64 {
        self.bytes.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes))
    }

    /// Number of the column in the revolution.
    pub(super) fn number(self) -> u16 {
        u16::from_le_bytes([self.bytes[8], self.bytes[9]])
    }

    /// Whether the sensor measured the column.
    pub(super) fn is_valid(self) -> bool {
        match self.profile {
            Profile::Legacy => self.bytes.ends_with(&[0xff; 4]),
            Profile::LowData | Profile::Single | Profile::Dual => self.bytes[10] & 1 == 1,
        }
    }

    /// Pixels, the highest beam first.
    pub(super) fn pixels(self) -> std::slice::ChunksExact<'a, u8> {
        let end = self.bytes.len() - self.profile.column_footer_bytes();
        self.bytes[self.profile.column_header_bytes()..end].chunks_exact(self.profile.pixel_bytes())
    }
}

/// Serial number of the sensor in a packet; `None` for `LEGACY`, which does not contain it.
pub(super) fn serial_number(payload: &[u8], profile: Profile) -> Option<u64> {
    let bytes: &[u8; 5] = payload.get(7..)?.first_chunk().filter(|_| profile != Profile::Legacy)?;
    Some(bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
}

/// Whether data packets of some Ouster have this size.
pub(crate) fn is_common_size(n_bytes: usize) -> bool {
    Profile::ALL.iter().any(|profile| BEAMS.iter().any(|n| profile.packet_bytes(COLUMNS, *n) == n_bytes))
}

/// Whether a payload is a packet of the sensor's IMU.
pub(crate) fn is_imu(payload: &[u8]) -> bool {
    payload.len() == IMU_BYTES
}
