//! Variable length records.

use crate::asprs::user_classes;

/// A variable length record.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Vlr {
    /// Up to 16 characters.
    pub(crate) user: &'static str,
    pub(crate) id: u16,
    /// Up to 32 characters.
    pub(crate) description: &'static str,
    /// Up to 65535 bytes.
    pub(crate) data: Vec<u8>,
}

impl Vlr {
    /// The coordinate reference system.
    pub(crate) fn wkt(wkt: &str) -> Self {
        let data = [wkt.as_bytes(), b"\0"].concat();
        Self { user: "LASF_Projection", id: 2112, description: "OGC coordinate system WKT", data }
    }
    /// A text for human readers.
    pub(crate) fn text(text: &str) -> Self {
        let data = [text.as_bytes(), b"\0"].concat();
        Self { user: "LASF_Spec", id: 3, description: "text area", data }
    }
    /// Names of the classes that the ASPRS does not define.
    pub(crate) fn class_names() -> Self {
        let mut data = Vec::new();
        for (number, name) in user_classes() {
            data.push(number);
            data.extend(padded::<15>(name));
        }
        // The table of the specification has 256 entries.
        data.resize(256 * 16, 0);
        Self { user: "LASF_Spec", id: 0, description: "classes from 64 on", data }
    }
    /// The compression.
    pub(crate) fn laszip(vlr: &laz::LazVlr) -> Self {
        let mut data = Vec::new();
        // Writing to a vector cannot fail.
        let _ = vlr.write_to(&mut data);
        Self { user: "laszip encoded", id: 22_204, description: "by the crate laz", data }
    }

    /// The bytes in a file.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut bytes = vec![0; 2];
        bytes.extend(padded::<16>(self.user));
        bytes.extend(self.id.to_le_bytes());
        bytes.extend((self.data.len() as u16).to_le_bytes());
        bytes.extend(padded::<32>(self.description));
        bytes.extend_from_slice(&self.data);
        bytes
    }
}

/// An extended record, which follows the points and may be longer.
pub(crate) fn evlr_bytes(user: &str, id: u16, description: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; 2];
    bytes.extend(padded::<16>(user));
    bytes.extend(id.to_le_bytes());
    bytes.extend((data.len() as u64).to_le_bytes());
    bytes.extend(padded::<32>(description));
    bytes.extend_from_slice(data);
    bytes
}

/// A text in `N` bytes, truncated or padded with zeros.
pub(super) fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut bytes = [0; N];
    let n = text.len().min(N);
    bytes[..n].copy_from_slice(&text.as_bytes()[..n]);
    bytes
}
