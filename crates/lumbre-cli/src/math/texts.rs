//! All sentences that are printed, as one table a language: another language is another file beside `english.rs`.

/// The sentences of one language; `{0}` and `{1}` stand for what is filled in.
#[derive(Debug)]
pub(super) struct Texts {
    // What values are called.
    pub(super) number: &'static str,
    pub(super) vector: &'static str,
    pub(super) vector_of: &'static str,
    pub(super) vector_2_or_3: &'static str,
    pub(super) vector_or_quaternion: &'static str,
    pub(super) matrix: &'static str,
    pub(super) matrix_of: &'static str,
    pub(super) square_matrix: &'static str,
    pub(super) transform: &'static str,
    pub(super) transform_or_quaternion: &'static str,
    pub(super) quaternion: &'static str,
    // What is wrong in the text.
    pub(super) unknown_character: &'static str,
    pub(super) characters: &'static str,
    pub(super) not_a_number: &'static str,
    pub(super) number_form: &'static str,
    pub(super) unexpected: &'static str,
    pub(super) end: &'static str,
    pub(super) operand: &'static str,
    pub(super) operator_or_end: &'static str,
    pub(super) operator_or_parenthesis: &'static str,
    pub(super) no_tuple: &'static str,
    pub(super) comma_or_bracket: &'static str,
    pub(super) comma_or_parenthesis: &'static str,
    pub(super) too_deep: &'static str,
    pub(super) too_many: &'static str,
    pub(super) at_most: &'static str,
    pub(super) name_is_taken: &'static str,
    pub(super) another_name: &'static str,
    pub(super) unknown_name: &'static str,
    pub(super) unknown_function: &'static str,
    pub(super) known_names: &'static str,
    pub(super) call_it: &'static str,
    pub(super) wrong_list: &'static str,
    pub(super) numbers_or_rows: &'static str,
    pub(super) nothing: &'static str,
    pub(super) entries: &'static str,
    pub(super) vector_size: &'static str,
    pub(super) matrix_size: &'static str,
    pub(super) like_the_first: &'static str,
    pub(super) wrong_count: &'static str,
    // What is wrong with the values.
    pub(super) wrong_argument: &'static str,
    pub(super) no_operation: &'static str,
    pub(super) same_kind: &'static str,
    pub(super) two_products: &'static str,
    pub(super) rotate_by_quaternion: &'static str,
    pub(super) sizes_fit: &'static str,
    pub(super) divisors: &'static str,
    pub(super) powers: &'static str,
    pub(super) no_inverse: &'static str,
    pub(super) invertible: &'static str,
    pub(super) inverted_kinds: &'static str,
    pub(super) affine_invertible: &'static str,
    pub(super) not_finite: &'static str,
    pub(super) finite: &'static str,
    pub(super) no_image: &'static str,
    pub(super) w_not_zero: &'static str,
    pub(super) not_zero: &'static str,
    pub(super) factors_not_zero: &'static str,
    pub(super) not_parallel: &'static str,
    pub(super) away_from_eye: &'static str,
    pub(super) not_along_view: &'static str,
    pub(super) another_side: &'static str,
    pub(super) opening: &'static str,
    pub(super) above_0: &'static str,
    pub(super) beyond_near: &'static str,
    pub(super) rotation_matrix: &'static str,
    // What steps say besides formulas.
    pub(super) acute: &'static str,
    pub(super) obtuse: &'static str,
    pub(super) right_angle: &'static str,
    pub(super) signed_length: &'static str,
    pub(super) smallest_component: &'static str,
    pub(super) one_direction: &'static str,
    pub(super) frame_rows: &'static str,
    pub(super) moves_points: &'static str,
    pub(super) point_has_w_1: &'static str,
    pub(super) direction_has_w_0: &'static str,
    pub(super) divided_by_w: &'static str,
    pub(super) right_first: &'static str,
    pub(super) row_on_the_left: &'static str,
    pub(super) columns: &'static str,
    pub(super) rows: &'static str,
    pub(super) rows_turn_back: &'static str,
    pub(super) b_first: &'static str,
    pub(super) cramer: &'static str,
    pub(super) mirrors: &'static str,
    pub(super) flattens: &'static str,
    pub(super) keeps_hand: &'static str,
    pub(super) looks_along_minus_z: &'static str,
    pub(super) looks_along_z: &'static str,
    pub(super) eye_to_origin: &'static str,
    pub(super) box_to_cube: &'static str,
    pub(super) depth_range: &'static str,
    pub(super) depth_is_lost: &'static str,
    pub(super) largest_part: &'static str,
    pub(super) north: &'static str,
    pub(super) south: &'static str,
    // A mistake, the prompt and the command.
    pub(super) found: &'static str,
    pub(super) expected: &'static str,
    pub(super) did_you_mean: &'static str,
    pub(super) expression: &'static str,
    pub(super) standard_input: &'static str,
    pub(super) welcome: &'static str,
    pub(super) not_utf8: &'static str,
    pub(super) not_regular: &'static str,
    pub(super) too_long: &'static str,
    pub(super) language: &'static str,
    /// What each function does, by its name.
    pub(super) functions: &'static [(&'static str, &'static str)],
}

impl Texts {
    /// What a function does.
    pub(super) fn about(&self, function: &str) -> &'static str {
        self.functions.iter().find(|(name, _)| *name == function).map_or("", |(_, about)| about)
    }
}

#[test]
fn every_sentence_is_translated() {
    use super::{ENGLISH, SPANISH};
    let names: Vec<&str> = ENGLISH.functions.iter().map(|(name, _)| *name).collect();
    crate::language::tests::assert_translated(&ENGLISH, &SPANISH, &names);
}
