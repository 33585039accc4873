-- Frequencies of the bins that results are made of.
create table frequency_bin (
    experiment_hash text collate "C" not null,
    -- From 0, ascending.
    bin bigint not null,
    frequency_Hz double precision not null,
    constraint a_bin_has_one_frequency primary key (experiment_hash, bin)
);

-- Surrogates that were trained together.
create table training (
    -- Hash of the rest, but for created_at: training again changes nothing.
    id text collate "C" not null primary key,
    campaign_id text collate "C" not null references campaign (id),
    -- Digest of the campaign when it was read.
    library_digest text collate "C" not null,
    -- Cases, those kept for testing included, and what decides which these are.
    cases bigint not null,
    seed bigint not null,
    code_version text collate "C" not null,
    created_at text collate "C" not null
);

-- How well each of them does on cases it was not trained on.
create table surrogate (
    training_id text collate "C" not null references training (id),
    feature text collate "C" not null,
    -- The speeds it reads together: JSON array, ascending.
    speeds_km_h text collate "C" not null,
    parameter text collate "C" not null,
    -- Mean absolute error over the parameter's range (0.05 is 5 %).
    mase_test double precision not null,
    mase_folds double precision not null,
    -- Share of the test cases inside their 90 % intervals.
    coverage_90_test double precision not null,
    constraint a_surrogate_is_trained_once
        primary key (training_id, feature, speeds_km_h, parameter)
);

create table evaluation (
    id text collate "C" not null primary key,
    -- The recording's name.
    recording text collate "C" not null,
    method text collate "C" not null,
    -- What the surrogates were trained on.
    campaign_id text collate "C" not null references campaign (id),
    library_digest text collate "C" not null,
    code_version text collate "C" not null,
    -- evaluation.json, whole.
    document text collate "C" not null,
    created_at text collate "C" not null,
    constraint evaluation_document_is_json check (document::jsonb is not null)
);

-- What an evaluation says of each sleeper: means, and standard deviations in the same unit; null
-- for a parameter that the campaign does not vary.
create table sleeper_estimate (
    evaluation_id text collate "C" not null references evaluation (id),
    sleeper text collate "C" not null,
    x_m double precision not null,
    railpad_stiffness_N_m double precision,
    railpad_stiffness_N_m_sd double precision,
    railpad_damping_N_s_m double precision,
    railpad_damping_N_s_m_sd double precision,
    ballast_stiffness_N_m double precision,
    ballast_stiffness_N_m_sd double precision,
    ballast_damping_N_s_m double precision,
    ballast_damping_N_s_m_sd double precision,
    sleeper_EI_N_m2 double precision,
    sleeper_EI_N_m2_sd double precision,
    irregularity_level double precision,
    irregularity_level_sd double precision,
    -- What to keep in mind, in a few words; empty if nothing.
    flags text collate "C" not null,
    constraint a_sleeper_is_estimated_once primary key (evaluation_id, sleeper)
);

create table diagnosis (
    id text collate "C" not null primary key,
    recording text collate "C" not null,
    verdict text collate "C" not null,
    code_version text collate "C" not null,
    -- diagnosis.json, whole.
    document text collate "C" not null,
    created_at text collate "C" not null,
    constraint diagnosis_document_is_json check (document::jsonb is not null),
    constraint verdict_is_known check (verdict in (
        'consistent', 'left_out_physics', 'unknown_physics', 'measurement_chain'))
);

-- Where a recording and the twin differ.
create table mismatch (
    diagnosis_id text collate "C" not null references diagnosis (id),
    -- From 1, as in the document.
    place bigint not null,
    from_x_m double precision not null,
    to_x_m double precision not null,
    from_frequency_Hz double precision not null,
    to_frequency_Hz double precision not null,
    level_dB double precision not null,
    p_value double precision not null,
    constraint a_mismatch_has_one_place primary key (diagnosis_id, place)
);

-- What may explain it.
create table hypothesis (
    diagnosis_id text collate "C" not null references diagnosis (id),
    -- From 1, the most probable first.
    place bigint not null,
    physics text collate "C" not null,
    -- Of this physics being present.
    probability double precision not null,
    -- Where; null where it is everywhere or nowhere in particular.
    from_x_m double precision,
    to_x_m double precision,
    -- JSON object: name with unit to mean and sd.
    parameters text collate "C" not null,
    constraint a_hypothesis_has_one_place primary key (diagnosis_id, place),
    constraint hypothesis_parameters_are_json check (parameters::jsonb is not null),
    constraint probability_is_one check (probability between 0 and 1)
);

-- Series of numbers that are dear to compute, by a hash of what they follow from.
create table stored_array (
    key text collate "C" not null primary key,
    kind text collate "C" not null,
    -- JSON: what they are.
    meta text collate "C" not null,
    numbers double precision[] not null,
    created_at text collate "C" not null,
    constraint meta_is_json check (meta::jsonb is not null)
);

-- Cases finished and failed in each interval of ten seconds, over all coordinators.
create view campaign_progress as
select
    campaign_id,
    from_unix_s,
    cast(sum(finished) as bigint) as finished,
    cast(sum(failed) as bigint) as failed,
    sum(busy_s) as busy_s
from progress
group by campaign_id, from_unix_s;

-- One row a case, speed and frequency bin: ln LWPS, in (m/s2)^2.
create view spectrum as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    frequency_bin.bin,
    frequency_bin.frequency_Hz,
    result.log_power[frequency_bin.bin + 1] as log_power
from result
join frequency_bin using (experiment_hash);
