-- Frequencies of the bins that results are made of.
create table frequency_bin (
    experiment_hash text not null,
    -- From 0, ascending.
    bin integer not null,
    frequency_Hz real not null,
    constraint a_bin_has_one_frequency primary key (experiment_hash, bin)
) strict, without rowid;

-- Surrogates that were trained together.
create table training (
    -- Hash of the rest, but for created_at: training again changes nothing.
    id text not null primary key,
    campaign_id text not null references campaign (id),
    -- Digest of the campaign when it was read.
    library_digest text not null,
    -- Cases, those kept for testing included, and what decides which these are.
    cases integer not null,
    seed integer not null,
    code_version text not null,
    created_at text not null
) strict, without rowid;

-- How well each of them does on cases it was not trained on.
create table surrogate (
    training_id text not null references training (id),
    feature text not null,
    -- The speeds it reads together: JSON array, ascending.
    speeds_km_h text not null,
    parameter text not null,
    -- Mean absolute error over the parameter's range (0.05 is 5 %).
    mase_test real not null,
    mase_folds real not null,
    -- Share of the test cases inside their 90 % intervals.
    coverage_90_test real not null,
    constraint a_surrogate_is_trained_once
        primary key (training_id, feature, speeds_km_h, parameter)
) strict, without rowid;

create table evaluation (
    id text not null primary key,
    -- The recording's name.
    recording text not null,
    method text not null,
    -- What the surrogates were trained on.
    campaign_id text not null references campaign (id),
    library_digest text not null,
    code_version text not null,
    -- evaluation.json, whole.
    document text not null,
    created_at text not null,
    constraint evaluation_document_is_json check (json_valid(document))
) strict, without rowid;

-- What an evaluation says of each sleeper: means, and standard deviations in the same unit; null
-- for a parameter that the campaign does not vary.
create table sleeper_estimate (
    evaluation_id text not null references evaluation (id),
    sleeper text not null,
    x_m real not null,
    railpad_stiffness_N_m real,
    railpad_stiffness_N_m_sd real,
    railpad_damping_N_s_m real,
    railpad_damping_N_s_m_sd real,
    ballast_stiffness_N_m real,
    ballast_stiffness_N_m_sd real,
    ballast_damping_N_s_m real,
    ballast_damping_N_s_m_sd real,
    sleeper_EI_N_m2 real,
    sleeper_EI_N_m2_sd real,
    irregularity_level real,
    irregularity_level_sd real,
    -- What to keep in mind, in a few words; empty if nothing.
    flags text not null,
    constraint a_sleeper_is_estimated_once primary key (evaluation_id, sleeper)
) strict, without rowid;

create table diagnosis (
    id text not null primary key,
    recording text not null,
    verdict text not null,
    code_version text not null,
    -- diagnosis.json, whole.
    document text not null,
    created_at text not null,
    constraint diagnosis_document_is_json check (json_valid(document)),
    constraint verdict_is_known check (verdict in (
        'consistent', 'left_out_physics', 'unknown_physics', 'measurement_chain'))
) strict, without rowid;

-- Where a recording and the twin differ.
create table mismatch (
    diagnosis_id text not null references diagnosis (id),
    -- From 1, as in the document.
    place integer not null,
    from_x_m real not null,
    to_x_m real not null,
    from_frequency_Hz real not null,
    to_frequency_Hz real not null,
    level_dB real not null,
    p_value real not null,
    constraint a_mismatch_has_one_place primary key (diagnosis_id, place)
) strict, without rowid;

-- What may explain it.
create table hypothesis (
    diagnosis_id text not null references diagnosis (id),
    -- From 1, the most probable first.
    place integer not null,
    physics text not null,
    -- Of this physics being present.
    probability real not null,
    -- Where; null where it is everywhere or nowhere in particular.
    from_x_m real,
    to_x_m real,
    -- JSON object: name with unit to mean and sd.
    parameters text not null,
    constraint a_hypothesis_has_one_place primary key (diagnosis_id, place),
    constraint hypothesis_parameters_are_json check (json_valid(parameters)),
    constraint probability_is_one check (probability between 0 and 1)
) strict, without rowid;

-- Series of numbers that are dear to compute, by a hash of what they follow from.
create table stored_array (
    key text not null primary key,
    kind text not null,
    -- JSON: what they are.
    meta text not null,
    numbers blob not null,
    created_at text not null,
    constraint meta_is_json check (json_valid(meta))
) strict;

-- Cases finished and failed in each interval of ten seconds, over all coordinators.
create view campaign_progress as
select
    campaign_id,
    from_unix_s,
    sum(finished) as finished,
    sum(failed) as failed,
    sum(busy_s) as busy_s
from progress
group by campaign_id, from_unix_s;

-- One row a case, speed and frequency bin: ln LWPS, in (m/s2)^2.
--
-- SQLite has no function that reads a double from a blob; this reads its hexadecimal digits: sign and
-- exponent in three, the mantissa in thirteen. Exact to the bit for values that are 0 or between 2e-22
-- and 4e34; smaller ones read as 0.
create view spectrum as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    frequency_bin.bin,
    frequency_bin.frequency_Hz,
    (
        select
            case when head >= 2048 then -1.0 else 1.0 end * case
                when shift >= 0 then mantissa * (1 << shift)
                when shift >= -62 then mantissa / (1 << -shift)
                when shift >= -124 then mantissa / (1 << 62) / (1 << (-shift - 62))
                else 0.0
            end
        from (
            select
                head,
                (head & 2047) - 1075 as shift,
                cast((1 << 52) + (instr('123456789ABCDEF', substr(digits, 4, 1)) << 48)
                    + (instr('123456789ABCDEF', substr(digits, 5, 1)) << 44)
                    + (instr('123456789ABCDEF', substr(digits, 6, 1)) << 40)
                    + (instr('123456789ABCDEF', substr(digits, 7, 1)) << 36)
                    + (instr('123456789ABCDEF', substr(digits, 8, 1)) << 32)
                    + (instr('123456789ABCDEF', substr(digits, 9, 1)) << 28)
                    + (instr('123456789ABCDEF', substr(digits, 10, 1)) << 24)
                    + (instr('123456789ABCDEF', substr(digits, 11, 1)) << 20)
                    + (instr('123456789ABCDEF', substr(digits, 12, 1)) << 16)
                    + (instr('123456789ABCDEF', substr(digits, 13, 1)) << 12)
                    + (instr('123456789ABCDEF', substr(digits, 14, 1)) << 8)
                    + (instr('123456789ABCDEF', substr(digits, 15, 1)) << 4)
                    + (instr('123456789ABCDEF', substr(digits, 16, 1)) << 0) as real) as mantissa
            from (
                select
                    digits,
                    (instr('123456789ABCDEF', substr(digits, 1, 1)) << 8)
                    + (instr('123456789ABCDEF', substr(digits, 2, 1)) << 4)
                    + instr('123456789ABCDEF', substr(digits, 3, 1)) as head
                from (select hex(substr(result.log_power, 8 * frequency_bin.bin + 1, 8)) as digits)
            )
        )
    ) as log_power
from result
join frequency_bin using (experiment_hash);
