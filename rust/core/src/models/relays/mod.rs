//! Models of relays and branches at the input: Preisach and Duhem.

pub(super) mod duhem;
pub(super) mod duhem_operator;
pub(super) mod everett;
pub(super) mod preisach;
pub(super) mod preisach_operator;
pub(super) mod reversals;
