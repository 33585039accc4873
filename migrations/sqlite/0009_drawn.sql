-- Campaigns vary numbers of the description and extensions besides the six parameters.

-- What was drawn for the case besides its parameters, by name: JSON object of numbers; null where nothing was, or where
-- the case was stored before there was this column.
alter table campaign_case add column drawn text constraint drawn_is_a_json_object check (json_type(drawn) = 'object');
