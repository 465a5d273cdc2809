//! Texts: ties and constraints between parameters, names of models and parts.

use piezotrack_core::Error;
use piezotrack_core::identify::{Constraint, Tie};
use piezotrack_core::models::Model;
use piezotrack_core::parts::Law;

use crate::bytes::Bytes;

/// Longest sentence of an error that repeats the text and lists all names, in characters.
const LONGEST: usize = 2000;

/// The first byte says which model, the second what the text is.
pub fn run(data: &[u8]) -> bool {
    let mut bytes = Bytes(data);
    let model = bytes.one_of(Model::ALL);
    let (infos, what) = (model.info().parameters, bytes.below(4));
    let text = String::from_utf8_lossy(bytes.0);
    let read = match what {
        0 | 1 => Tie::read(infos, what, &text).map(|tie| {
            let parameters: Vec<f64> = bytes.words().collect();
            assert!(tie.names().all(|place| place < infos.len()));
            // What is shown of it is itself such a text, with the same meaning.
            let again = Tie::read(infos, what, &tie.text).expect("a tie in one line");
            assert_eq!(again, tie);
            assert_eq!(again.value(&parameters).to_bits(), tie.value(&parameters).to_bits());
        }),
        2 => Constraint::read(infos, &text).map(|constraint| {
            assert!(constraint.lower != constraint.upper);
            assert!(constraint.lower.max(constraint.upper) < infos.len());
            let again = Constraint::read(infos, &constraint.text).expect("in one line");
            assert_eq!(again, constraint);
        }),
        _ => {
            Model::named(&text).map(drop).or_else(|_| Law::named(&text, &[1.0; 4], 1e-3).map(drop))
        }
    };
    read.map_err(|error| is_sentence(&error)).is_ok()
}

/// Errors are one line, and not as long as the text that they refuse.
fn is_sentence(error: &Error) {
    let sentence = error.to_string();
    assert!(sentence.contains("expected"), "{sentence}");
    assert!(sentence.chars().count() < LONGEST, "{sentence}");
    assert!(!sentence.contains(char::is_control), "{sentence:?}");
}
