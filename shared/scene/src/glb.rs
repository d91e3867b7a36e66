//! Meshes as binary glTF 2.0.
//!
//! Coordinates of scenes are x east, y north, z up; glTF has y up: x east, y up, z south.

use serde_json::json;

/// Vertices and triangles of a mesh, relative to its place.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions, m.
    pub positions: Vec<[f32; 3]>,
    /// sRGB.
    pub colors: Vec<[u8; 3]>,
    /// 1 where measured; less where completed.
    pub scores: Vec<f32>,
    /// Counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Kinds of numbers and of buffer views of glTF.
const U8: u32 = 5121;
const U32: u32 = 5125;
const F32: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// Length of the header of the file, and of each chunk, bytes.
const HEADER_BYTES: usize = 12;
const CHUNK_BYTES: usize = 8;

impl Mesh {
    /// The bytes of a GLB file with one node at `place`, m. `None` without triangles, because glTF has no empty meshes. Vertex colors are
    /// linear, as glTF defines them; `_SCORE` is 1 where the surface was measured and less where it was completed.
    pub fn to_glb(&self, name: &str, [x, y, z]: [f64; 3]) -> Option<Vec<u8>> {
        if self.triangles.is_empty() {
            return None;
        }
        let upright: Vec<[f32; 3]> = self.positions.iter().map(|[x, y, z]| [*x, *z, -*y]).collect();
        let bound = |start: f32, choose: fn(f32, f32) -> f32| {
            upright.iter().fold([start; 3], |bound, p| std::array::from_fn(|axis| choose(bound[axis], p[axis])))
        };
        let low = bound(f32::INFINITY, f32::min);
        let high = bound(f32::NEG_INFINITY, f32::max);
        let sections = [
            upright.iter().flatten().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>(),
            self.colors
                .iter()
                .flat_map(|rgb| {
                    let [r, g, b] = rgb.map(linear);
                    [r, g, b, u8::MAX]
                })
                .collect(),
            self.scores.iter().flat_map(|score| score.to_le_bytes()).collect(),
            self.triangles.iter().flatten().flat_map(|idx| idx.to_le_bytes()).collect(),
        ];
        let n = self.positions.len();
        let targets = [ARRAY_BUFFER, ARRAY_BUFFER, ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER];
        let mut views = Vec::new();
        let mut bytes: Vec<u8> = Vec::new();
        for (section, target) in sections.iter().zip(targets) {
            views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": section.len(), "target": target}));
            bytes.extend(section);
        }
        let document = json!({
            "asset": {"version": "2.0", "generator": "REPLICA"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"name": name, "mesh": 0, "translation": [x, z, -y]}],
            "meshes": [{"name": name, "primitives": [{
                "attributes": {"POSITION": 0, "COLOR_0": 1, "_SCORE": 2}, "indices": 3, "material": 0
            }]}],
            "materials": [{"name": name, "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9}}],
            "accessors": [
                {"bufferView": 0, "componentType": F32, "count": n, "type": "VEC3", "min": low, "max": high},
                {"bufferView": 1, "componentType": U8, "normalized": true, "count": n, "type": "VEC4"},
                {"bufferView": 2, "componentType": F32, "count": n, "type": "SCALAR"},
                {"bufferView": 3, "componentType": U32, "count": 3 * self.triangles.len(), "type": "SCALAR"},
            ],
            "bufferViews": views,
            "buffers": [{"byteLength": bytes.len()}],
        });
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = HEADER_BYTES + 2 * CHUNK_BYTES + text.len() + bytes.len();
        let mut file = Vec::with_capacity(total);
        file.extend(b"glTF");
        file.extend(2_u32.to_le_bytes());
        file.extend((total as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bytes)] {
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        Some(file)
    }
}

/// The linear value of a channel of sRGB (IEC 61966-2-1).
fn linear(value: u8) -> u8 {
    let value = f64::from(value) / 255.0;
    let linear = if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) };
    (255.0 * linear).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn file_has_whole_chunks_and_states_its_bounds() {
        let mesh = Mesh {
            positions: vec![[0.0, 0.0, 1.0], [2.0, 0.0, 1.5], [0.0, 3.0, 2.0]],
            colors: vec![[255, 0, 128]; 3],
            scores: vec![1.0, 1.0, 0.5],
            triangles: vec![[0, 1, 2]],
        };
        let file = mesh.to_glb("ground", [50.0, 100.0, 7.0]).expect("has a triangle");
        let number = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().expect("four bytes")) as usize;
        assert_eq!((&file[..4], number(4), number(8)), (b"glTF".as_slice(), 2, file.len()));
        let n_text = number(12);
        let text: Value = serde_json::from_slice(&file[20..20 + n_text]).expect("JSON");
        assert_eq!(text["accessors"][0]["min"], json!([0.0, 1.0, -3.0]));
        assert_eq!(text["nodes"][0]["translation"], json!([50.0, 7.0, -100.0]));
        let n_bytes = number(20 + n_text);
        assert_eq!(n_bytes, 3 * (12 + 4 + 4) + 12);
        assert_eq!(28 + n_text + n_bytes, file.len());
        assert_eq!(text["buffers"][0]["byteLength"], n_bytes);
        assert_eq!(&file[28 + n_text + 36..][..4], &[255, 0, 55, 255]);
        assert!(Mesh::default().to_glb("ground", [0.0; 3]).is_none());
    }
}
