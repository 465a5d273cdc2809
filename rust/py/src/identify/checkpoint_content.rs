//! Content of a checkpoint: its first line and the answers after it. Nothing of Python is here, so
//! that the fuzzers read it too.

use piezotrack_core::error::shown_text;

/// First words of the file, with the version of its format.
const FORMAT: &str = "piezotrack-checkpoint 1";

/// The first line of a file of the search `identity` with these answers.
pub fn head(identity: &str, answers: &[u8]) -> String {
    format!("{FORMAT} {identity} {} {:016x}\n", answers.len(), sum(answers))
}

/// Adds an answer.
pub fn keep(numbers: &[f64], bytes: &mut Vec<u8>) {
    bytes.extend((numbers.len() as u64).to_le_bytes());
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
}

/// The first answer of some bytes, if it has so many numbers, and its length in bytes.
pub fn answer(bytes: &[u8], count: usize) -> Option<(Vec<f64>, usize)> {
    let (head, rest) = bytes.split_first_chunk()?;
    let written = usize::try_from(u64::from_le_bytes(*head)).ok()?;
    let numbers = rest.get(..count.checked_mul(size_of::<f64>())?)?;
    let (numbers, _) = numbers.as_chunks();
    let found = numbers.iter().map(|number| f64::from_le_bytes(*number)).collect();
    (written == count).then_some((found, size_of::<u64>() + size_of::<f64>() * count))
}

/// The answers in the content of a file, or what is wrong with it.
pub fn payload(content: &[u8], identity: &str) -> Result<Vec<u8>, String> {
    let end = content.iter().take(200).position(|&byte| byte == b'\n');
    let head = end.and_then(|end| std::str::from_utf8(&content[..end]).ok()).unwrap_or("");
    let Some(words) = head.strip_prefix("piezotrack-checkpoint ") else {
        return Err("is no checkpoint: expected a file that a search has written, or none".into());
    };
    let words: Vec<&str> = words.split(' ').collect();
    let [version, known, length, total] = words[..] else {
        return Err("is not as it was written: expected it unchanged, or none".into());
    };
    if Some(version) != FORMAT.split(' ').next_back() {
        return Err(format!("is of version {}: expected 1", shown_text(version)));
    }
    if known != identity {
        return Err("is that of another search: expected the same records, model, arguments and \
                    version, or another file"
            .into());
    }
    let bytes = &content[head.len() + 1..];
    if length != bytes.len().to_string() || total != format!("{:016x}", sum(bytes)) {
        return Err("is not as it was written: expected it unchanged, or none".into());
    }
    Ok(bytes.to_vec())
}

/// FNV-1a of 64 bits, by words of eight bytes and the rest.
fn sum(bytes: &[u8]) -> u64 {
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    let (words, rest) = bytes.as_chunks::<8>();
    let words = words.iter().map(|word| u64::from_le_bytes(*word));
    let all = words.chain(rest.iter().map(|&byte| u64::from(byte)));
    all.fold(0xcbf2_9ce4_8422_2325, |sum, word| (sum ^ word).wrapping_mul(PRIME))
}
