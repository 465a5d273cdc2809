//! Checkpoints of searches: any bytes in place of the file.

#[path = "../../../rust/py/src/identify/checkpoint_content.rs"]
mod checkpoint_content;

use checkpoint_content::{answer, head, keep, payload};

use crate::bytes::Bytes;

/// Identity of the search that asks.
const IDENTITY: &str = "1f";

/// The bytes as a file, or as its answers below a right first line.
pub fn run(data: &[u8]) -> bool {
    let mut bytes = Bytes(data);
    let counts: [usize; 4] = core::array::from_fn(|_| bytes.below(8));
    let content = if bytes.flag() {
        bytes.0.to_vec()
    } else {
        [head(IDENTITY, bytes.0).as_bytes(), bytes.0].concat()
    };
    let answers = match payload(&content, IDENTITY) {
        Ok(answers) => answers,
        Err(reason) => {
            assert!(reason.contains("expected") && reason.len() < 1000, "{reason}");
            assert!(!reason.contains(char::is_control), "{reason:?}");
            return false;
        }
    };
    assert!(content.ends_with(&answers));
    let mut rest = &answers[..];
    for count in counts.into_iter().chain([usize::MAX, usize::MAX / 8]) {
        if let Some((numbers, length)) = answer(rest, count) {
            let mut again = Vec::new();
            keep(&numbers, &mut again);
            assert_eq!(again, rest[..length]);
            rest = &rest[length..];
        }
    }
    true
}
