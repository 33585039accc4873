-- Results carry a checksum that their worker made, and say for how long the wheel was in the air.

alter table case_result
    -- Share of the recorded time of each pass, 0 to 1, in which the wheel did not touch the rail; null where nobody
    -- told it.
    add column contact_loss_shares double precision[]
        constraint every_pass_has_its_contact_loss_share check (
            cardinality(contact_loss_shares) = cardinality(speeds_km_h))
        constraint contact_loss_shares_are_ones check (
            0 <= all (contact_loss_shares) and 1 >= all (contact_loss_shares)),
    -- Of the case's passes together (docs/checksums.md); null where the result was stored before there were any.
    add column checksum text collate "C";

-- Cases whose wheel was in the air: few, and counted often.
create index case_result_with_contact_loss on case_result (campaign_id, sobol_index)
    where 0 < any (contact_loss_shares);

-- One row a case and speed: what came out. Series are looked up one by one, and only where they are asked for.
create or replace view result as
select
    campaign_id,
    sobol_index,
    speed_km_h,
    (select log_power from case_series
        where case_series.result_id = case_result.id and case_series.speed_km_h = passes.speed_km_h) as log_power,
    levels_dB[20 * pass - 19] as level_50_Hz_dB,
    levels_dB[20 * pass - 18] as level_63_Hz_dB,
    levels_dB[20 * pass - 17] as level_80_Hz_dB,
    levels_dB[20 * pass - 16] as level_100_Hz_dB,
    levels_dB[20 * pass - 15] as level_125_Hz_dB,
    levels_dB[20 * pass - 14] as level_160_Hz_dB,
    levels_dB[20 * pass - 13] as level_200_Hz_dB,
    levels_dB[20 * pass - 12] as level_250_Hz_dB,
    levels_dB[20 * pass - 11] as level_315_Hz_dB,
    levels_dB[20 * pass - 10] as level_400_Hz_dB,
    levels_dB[20 * pass - 9] as level_500_Hz_dB,
    levels_dB[20 * pass - 8] as level_630_Hz_dB,
    levels_dB[20 * pass - 7] as level_800_Hz_dB,
    levels_dB[20 * pass - 6] as level_1000_Hz_dB,
    levels_dB[20 * pass - 5] as level_1250_Hz_dB,
    levels_dB[20 * pass - 4] as level_1600_Hz_dB,
    levels_dB[20 * pass - 3] as level_2000_Hz_dB,
    levels_dB[20 * pass - 2] as level_2500_Hz_dB,
    levels_dB[20 * pass - 1] as level_3150_Hz_dB,
    levels_dB[20 * pass] as level_4000_Hz_dB,
    duration_s,
    worker,
    code_version,
    model_hash,
    experiment_hash,
    parameter_hash,
    finished_at,
    flagged,
    contact_loss_shares[pass] as contact_loss_share,
    checksum
from case_result
cross join lateral (
    select speed_km_h, cast(place as integer) as pass
    from unnest(speeds_km_h) with ordinality as of (speed_km_h, place)) as passes;

-- One row a case and speed: what went in, and what came out.
create or replace view result_with_parameters as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    campaign_case.railpad_stiffness_N_m,
    campaign_case.railpad_damping_N_s_m,
    campaign_case.ballast_stiffness_N_m,
    campaign_case.ballast_damping_N_s_m,
    campaign_case.sleeper_EI_N_m2,
    campaign_case.irregularity_level,
    campaign_case.surface_seed,
    result.level_50_Hz_dB,
    result.level_63_Hz_dB,
    result.level_80_Hz_dB,
    result.level_100_Hz_dB,
    result.level_125_Hz_dB,
    result.level_160_Hz_dB,
    result.level_200_Hz_dB,
    result.level_250_Hz_dB,
    result.level_315_Hz_dB,
    result.level_400_Hz_dB,
    result.level_500_Hz_dB,
    result.level_630_Hz_dB,
    result.level_800_Hz_dB,
    result.level_1000_Hz_dB,
    result.level_1250_Hz_dB,
    result.level_1600_Hz_dB,
    result.level_2000_Hz_dB,
    result.level_2500_Hz_dB,
    result.level_3150_Hz_dB,
    result.level_4000_Hz_dB,
    result.log_power,
    result.duration_s,
    result.worker,
    result.code_version,
    result.model_hash,
    result.experiment_hash,
    result.parameter_hash,
    result.finished_at,
    result.flagged,
    result.contact_loss_share,
    result.checksum
from result
join campaign_case using (campaign_id, sobol_index);
